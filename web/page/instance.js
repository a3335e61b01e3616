// An instance of the library: asked in JSON, it answers in JSON.

import { wasi } from "./wasi.js";

export class Instance {
  /** Makes an instance of a compiled module; `file` is the only file that it can read: its name and bytes. */
  static async of(compiled, file = null) {
    const own = new Instance();
    own.host = { file, memory: null, said: "" };
    try {
      const instance = await WebAssembly.instantiate(compiled, { wasi_snapshot_preview1: wasi(own.host) });
      own.exports = instance.exports;
    } catch (error) {
      throw new Error(`There is not enough memory, or WebAssembly is too old here (${error.message}). ` +
        "Close other pages, or use another browser, or the program curvelax.");
    }
    own.host.memory = own.exports.memory;
    own.exports._initialize?.();
    return own;
  }

  set file(file) { this.host.file = file; }

  get memory() { return this.host.memory; }

  /** Asks, and returns the answer; what is wrong is thrown. */
  ask(request) {
    const { reserve, ask, answer, memory } = this.exports;
    const bytes = new TextEncoder().encode(JSON.stringify(request));
    const at = reserve(bytes.length);
    new Uint8Array(memory.buffer, at, bytes.length).set(bytes);
    let length;
    try {
      length = ask();
    } catch (error) {
      const words = this.host.said.trim() || error.message;
      throw new Error(/memory/i.test(words) ? `${words}: use fewer curves or nodes` : words);
    }
    const said = JSON.parse(new TextDecoder().decode(new Uint8Array(memory.buffer, answer(), length)));
    if (said.error) throw new Error(said.error);
    return said;
  }

  /** Hands over the bytes that came back from the GPU. */
  deliver(bytes) {
    const at = this.exports.reserve(bytes.length);
    new Uint8Array(this.memory.buffer, at, bytes.length).set(bytes);
    this.exports.deliver();
  }

  nodes(count) { return new Float32Array(this.memory.buffer, this.exports.nodes(), count).slice(); }

  rests(count) { return new Float32Array(this.memory.buffer, this.exports.rests(), count).slice(); }

  excess(count) { return new Float64Array(this.memory.buffer, this.exports.excess(), count).slice(); }
}
