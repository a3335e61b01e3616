// What a side has shown since its start, to be shown again.

/** Bytes of the nodes that are kept, and the most frames. */
const MAX_BYTES = 32e6, MAX_FRAMES = 300;

export class Film {
  constructor() { Object.assign(this, { frames: [], seen: 0, stride: 1 }); }

  /** Adds a frame: nodes, and how many members had ended. The first and the last one are always kept. */
  add(frame) {
    // The last one is kept only if it is one of every `stride`, or until another one comes.
    if (this.seen && (this.seen - 1) % this.stride) this.frames.pop();
    this.frames.push(frame);
    this.seen += 1;
    const most = Math.min(MAX_FRAMES, Math.max(2, Math.floor(MAX_BYTES / frame.nodes.byteLength)));
    if (this.frames.length <= most) return;
    this.stride *= 2;
    const isLast = (i) => i === this.frames.length - 1;
    this.frames = this.frames.filter((_, i) => i % 2 === 0 || isLast(i));
  }

  get start() { return this.frames[0]; }

  /** The frame at a share of the run. */
  at(share) { return this.frames[Math.round(share * (this.frames.length - 1))]; }

  get moves() { return this.frames.length > 1; }
}
