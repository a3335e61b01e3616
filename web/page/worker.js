// Runs the members, on the CPU or by WebGPU, and tells the page where they are. It is ended by the page.

import { Instance } from "./instance.js";
import { Kernel, adapter, isSoftware } from "./webgpu.js";

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
  const { vendor = "", architecture = "", description = "" } = found?.info ?? {};
  postMessage({ begins: { members, n, times, adapter: description || `${vendor} ${architecture}`.trim() } });
  let kernel = null;
  for (let continues = true; continues; ) {
    const turn = instance.ask({ ask: "turn" });
    continues = turn.continues;
    if (turn.frame) {
      const frame = instance.ask({ ask: "frame" });
      const [nodes, excess] = [instance.nodes(2 * members * n), instance.excess(members * times.length)];
      const rests = instance.rests(frame.rests);
      postMessage({ frame: { ...frame, nodes, excess, rests } }, [nodes.buffer, excess.buffer, rests.buffer]);
    }
    if (!turn.dispatch) continue;
    if (!kernel) {
      postMessage({ compiling: true });
      kernel = await Kernel.open(found, gpu);
    }
    instance.deliver(await kernel.dispatch(turn.dispatch, instance.memory));
  }
}
