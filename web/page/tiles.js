// The members of a run, each in a tile of its own.

export class Tiles {
  /** Tiles on `canvas` in the colour of this name. */
  constructor(canvas, colour) {
    Object.assign(this, { canvas, colour, frames: null });
  }

  clear() {
    this.frames = null;
    const { canvas } = this;
    canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
  }

  /** Draws all members from their nodes, x and y of each; those that have ended are filled. */
  draw(nodes, n, ended) {
    const { canvas } = this, members = nodes.length / (2 * n);
    const pixels = (size) => Math.round(size * devicePixelRatio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(pixels);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    this.frames ??= new Array(members).fill(null);
    let columns = 1;
    while (Math.floor(height / (width / columns)) * columns < members) columns++;
    const tile = width / columns, context = canvas.getContext("2d"), style = getComputedStyle(canvas);
    const paths = [new Path2D(), new Path2D()];
    for (let member = 0; member < members; member++) {
      const own = nodes.subarray(2 * n * member, 2 * n * (member + 1));
      if (Number.isNaN(own[0])) continue;
      // A curve keeps the scale of its first frame, so that one sees it grow or shrink.
      const [x, y, size] = (this.frames[member] ??= frame(own));
      const scale = (0.42 * tile) / size, path = paths[ended.has(member) ? 1 : 0];
      const [left, top] = [((member % columns) + 0.5) * tile, (Math.floor(member / columns) + 0.5) * tile];
      for (let i = 0; i < own.length; i += 2) {
        path[i ? "lineTo" : "moveTo"](left + (own[i] - x) * scale, top - (own[i + 1] - y) * scale);
      }
      path.closePath();
    }
    context.clearRect(0, 0, width, height);
    context.lineJoin = "round";
    context.strokeStyle = context.fillStyle = style.getPropertyValue(this.colour);
    paths.forEach((path, i) => {
      context.lineWidth = (i ? 1 : 1.5) * devicePixelRatio;
      context.globalAlpha = i ? 0.25 : 0.08;
      context.fill(path);
      context.globalAlpha = i ? 0.5 : 1;
      context.stroke(path);
    });
    context.globalAlpha = 1;
  }
}

/** Centre and half the size of a curve. */
function frame(nodes) {
  const ends = [Infinity, -Infinity, Infinity, -Infinity];
  for (let i = 0; i < nodes.length; i += 2) {
    ends[0] = Math.min(ends[0], nodes[i]);
    ends[1] = Math.max(ends[1], nodes[i]);
    ends[2] = Math.min(ends[2], nodes[i + 1]);
    ends[3] = Math.max(ends[3], nodes[i + 1]);
  }
  return [(ends[0] + ends[1]) / 2, (ends[2] + ends[3]) / 2, Math.max(ends[1] - ends[0], ends[3] - ends[2]) / 2 || 1];
}
