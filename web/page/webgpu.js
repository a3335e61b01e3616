// Carries the library's kernel, its buffers and its dispatches to WebGPU.

/** The adapter of this browser, or an error that says why there is none. */
export async function adapter() {
  if (!navigator.gpu) throw new Error("this browser has no WebGPU, or the page has no right to it (it needs https)");
  const found = await navigator.gpu.requestAdapter();
  if (!found) throw new Error("this browser has WebGPU, and no adapter for it");
  return found;
}

/** Whether an adapter is software, which rounds as the CPU does. */
export function isSoftware({ info = {}, isFallbackAdapter }) {
  const words = [info.vendor, info.architecture, info.device, info.description].join(" ");
  return Boolean(isFallbackAdapter || info.isFallbackAdapter || /swiftshader|llvmpipe|warp|basic render/i.test(words));
}

export class Kernel {
  static async open(found, { code, constants, buffers, back }) {
    const own = new Kernel();
    const device = await found.requestDevice();
    own.device = device;
    own.failed = new Promise((_, fail) => {
      device.lost.then(({ message }) => fail(new Error(`the GPU was lost: ${message}`)));
      device.addEventListener("uncapturederror", ({ error }) => fail(new Error(`the GPU refused: ${error.message}`)));
    });
    own.failed.catch(() => {});
    const module = device.createShaderModule({ code });
    const compute = { module, entryPoint: "evolve", constants };
    own.pipeline = await Promise.race([own.failed, device.createComputePipelineAsync({ layout: "auto", compute })]);
    const { STORAGE, UNIFORM, COPY_SRC, COPY_DST, MAP_READ } = GPUBufferUsage;
    own.buffers = buffers.map(({ name, bytes, uniform }) =>
      device.createBuffer({ label: name, size: bytes, usage: (uniform ? UNIFORM : STORAGE) | COPY_SRC | COPY_DST }));
    own.back = back.map((binding) => own.buffers[binding]);
    const size = own.back.reduce((sum, buffer) => sum + buffer.size, 0);
    own.staging = device.createBuffer({ label: "staging", size, usage: MAP_READ | COPY_DST });
    own.group = device.createBindGroup({
      layout: own.pipeline.getBindGroupLayout(0),
      entries: own.buffers.map((buffer, binding) => ({ binding, resource: { buffer } })),
    });
    return own;
  }

  /** Writes, dispatches, and returns the bytes that come back. */
  async dispatch({ writes, groups }, memory) {
    const { device, pipeline, group, buffers, back, staging } = this;
    for (const [binding, offset, at, length] of writes) {
      device.queue.writeBuffer(buffers[binding], offset, memory.buffer, at, length);
    }
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, group);
    pass.dispatchWorkgroups(groups);
    pass.end();
    let at = 0;
    for (const buffer of back) {
      encoder.copyBufferToBuffer(buffer, 0, staging, at, buffer.size);
      at += buffer.size;
    }
    device.queue.submit([encoder.finish()]);
    await Promise.race([this.failed, staging.mapAsync(GPUMapMode.READ)]);
    const bytes = new Uint8Array(staging.getMappedRange().slice(0));
    staging.unmap();
    return bytes;
  }
}
