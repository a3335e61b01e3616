// The part of WASI that the module uses: a clock, random numbers, messages, and one file in memory.

const OK = 0, BAD = 8, NO_ENTRY = 44, NOT_THERE = 52;
const FOLDER = 3, FILE = 4; // file types, and the descriptors used for them

/** What a module of wasm32-wasip1 imports. `module.memory` is set once it exists; `module.file` is its only file. */
export function wasi(module) {
  const view = () => new DataView(module.memory.buffer);
  const bytes = (at, length) => new Uint8Array(module.memory.buffer, at, length);
  const isFile = (at, length) => module.file && new TextDecoder().decode(bytes(at, length)) === module.file.name;
  const stat = (at, type, size) => {
    bytes(at, 64).fill(0);
    view().setUint8(at + 16, type);
    view().setBigUint64(at + 32, BigInt(size), true);
    return OK;
  };
  const place = { at: 0 };
  let said = "";
  const known = {
    clock_time_get(clock, precision, at) {
      const milliseconds = clock === 0 ? Date.now() : performance.now();
      view().setBigUint64(at, BigInt(Math.round(milliseconds * 1e6)), true);
      return OK;
    },
    random_get(at, length) {
      crypto.getRandomValues(bytes(at, length));
      return OK;
    },
    fd_write(descriptor, vectors, count, written) {
      let total = 0;
      for (let i = 0; i < count; i++) {
        const [at, length] = [0, 4].map((by) => view().getUint32(vectors + 8 * i + by, true));
        said += new TextDecoder().decode(bytes(at, length));
        total += length;
      }
      view().setUint32(written, total, true);
      module.said = said.slice(-2000);
      return OK;
    },
    proc_exit(code) {
      throw new Error(`the module has ended with ${code}: ${said.trim()}`);
    },
    environ_sizes_get(count, size) {
      view().setUint32(count, 0, true);
      view().setUint32(size, 0, true);
      return OK;
    },
    environ_get: () => OK,
    sched_yield: () => OK,
    fd_prestat_get(descriptor, at) {
      if (descriptor !== FOLDER) return BAD;
      view().setUint32(at, 0, true);
      view().setUint32(at + 4, 1, true);
      return OK;
    },
    fd_prestat_dir_name(descriptor, at) {
      if (descriptor !== FOLDER) return BAD;
      bytes(at, 1)[0] = "/".charCodeAt(0);
      return OK;
    },
    fd_fdstat_get(descriptor, at) {
      bytes(at, 24).fill(0);
      view().setUint8(at, descriptor === FOLDER ? FOLDER : FILE);
      view().setBigUint64(at + 8, ~0n & 0xffffffffffffffffn, true);
      view().setBigUint64(at + 16, ~0n & 0xffffffffffffffffn, true);
      return OK;
    },
    fd_fdstat_set_flags: () => OK,
    path_filestat_get(folder, flags, path, length, at) {
      return isFile(path, length) ? stat(at, FILE, module.file.bytes.length) : NO_ENTRY;
    },
    path_open(folder, flags, path, length, how, base, inheriting, more, at) {
      if (!isFile(path, length)) return NO_ENTRY;
      place.at = 0;
      view().setUint32(at, FILE, true);
      return OK;
    },
    fd_filestat_get(descriptor, at) {
      return descriptor === FILE ? stat(at, FILE, module.file.bytes.length) : stat(at, FOLDER, 0);
    },
    fd_read(descriptor, vectors, count, read) {
      if (descriptor !== FILE) return BAD;
      let total = 0;
      for (let i = 0; i < count; i++) {
        const [at, length] = [0, 4].map((by) => view().getUint32(vectors + 8 * i + by, true));
        const part = module.file.bytes.subarray(place.at, place.at + length);
        bytes(at, length).set(part);
        place.at += part.length;
        total += part.length;
      }
      view().setUint32(read, total, true);
      return OK;
    },
    fd_seek(descriptor, offset, whence, at) {
      if (descriptor !== FILE) return BAD;
      place.at = Number(offset) + [0, place.at, module.file.bytes.length][whence];
      view().setBigUint64(at, BigInt(place.at), true);
      return OK;
    },
    fd_close: () => OK,
  };
  return new Proxy(known, { get: (own, name) => own[name] ?? (() => NOT_THERE) });
}
