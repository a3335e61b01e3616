// Runs the members, on the CPU or by WebGPU, and tells the page where they are. It is ended by the page.

import { Instance } from "./instance.js";
import { Kernel, adapter, isSoftware } from "./webgpu.js";

/** Milliseconds between two frames. */
const FRAME = 40;

addEventListener("message", async ({ data: { compiled, settings, file, place } }) => {
  try {
    await run(compiled, settings, file, place);
  } catch (error) {
    postMessage({ error: error.message });
  }
});

async function run(compiled, settings, file, place) {
  const found = place === "gpu" ? await adapter().catch((error) => void postMessage({ none: error.message })) : null;
  if (place === "gpu" && !found) return;
  const instance = await Instance.of(compiled, file);
  const asked = found ? { gpu: { hardware: !isSoftware(found) } } : "cpu";
  const { members, n, times, gpu } = instance.ask({ ask: "start", settings, place: asked });
  postMessage({ compiling: Boolean(gpu) });
  const kernel = gpu && (await Kernel.open(found, gpu));
  const { vendor = "", architecture = "", description = "" } = found?.info ?? {};
  postMessage({ begins: { members, n, times, adapter: description || `${vendor} ${architecture}`.trim() } });
  let shown = 0;
  for (let goesOn = true; goesOn; ) {
    const turn = instance.ask({ ask: "turn" });
    goesOn = turn.goesOn;
    if (goesOn && shown && performance.now() - shown < FRAME) {
      if (turn.dispatch) instance.deliver(await kernel.dispatch(turn.dispatch, instance.memory));
      continue;
    }
    const frame = instance.ask({ ask: "frame" });
    const [nodes, excess] = [instance.nodes(2 * members * n), instance.excess(members * times.length)];
    postMessage({ frame: { ...frame, nodes, excess } }, [nodes.buffer, excess.buffer]);
    shown = performance.now();
    // What is fetched is in memory until the next turn, so a frame may come in between.
    if (turn.dispatch) instance.deliver(await kernel.dispatch(turn.dispatch, instance.memory));
  }
}
