// The members of a run, each in a tile of its own, in front of its outline at the start and of its Wulff shape.

export class Tiles {
  /** Tiles on `canvas` in the colour of this name. */
  constructor(canvas, colour) {
    Object.assign(this, { canvas, colour });
  }

  clear() {
    const { canvas } = this;
    canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
  }

  /**
   * Draws all members from their nodes, x and y of each, now and at the start; those that have ended are filled.
   * `rests` has a Wulff shape for each, or is empty.
   */
  draw(nodes, start, rests, n, ended) {
    const { canvas } = this, members = nodes.length / (2 * n);
    const pixels = (size) => Math.round(size * devicePixelRatio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(pixels);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    let columns = 1;
    while (Math.floor(height / (width / columns)) * columns < members) columns++;
    const tile = width / columns, context = canvas.getContext("2d"), style = getComputedStyle(canvas);
    const [before, rest, moving, over] = [0, 1, 2, 3].map(() => new Path2D());
    for (let member = 0; member < members; member++) {
      const of = (all) => all.subarray(all.length / members * member, all.length / members * (member + 1));
      const [now, first] = [of(nodes), of(start)];
      if (Number.isNaN(now[0]) || Number.isNaN(first[0])) continue;
      // A curve keeps the scale of its start, so that one sees it grow or shrink.
      const [x, y, size] = frame(first), scale = (0.42 * tile) / size;
      const [left, top] = [((member % columns) + 0.5) * tile, (Math.floor(member / columns) + 0.5) * tile];
      const add = (path, points) => {
        for (let i = 0; i < points.length; i += 2) {
          path[i ? "lineTo" : "moveTo"](left + (points[i] - x) * scale, top - (points[i + 1] - y) * scale);
        }
        path.closePath();
      };
      add(before, first);
      if (rests.length) add(rest, of(rests));
      add(ended.has(member) ? over : moving, now);
    }
    context.clearRect(0, 0, width, height);
    context.lineJoin = "round";
    const stroke = (path, colour, line) => {
      context.strokeStyle = style.getPropertyValue(colour);
      context.lineWidth = line * devicePixelRatio;
      context.stroke(path);
    };
    context.fillStyle = style.getPropertyValue(this.colour);
    context.globalAlpha = 0.2;
    context.fill(over);
    context.globalAlpha = 1;
    stroke(before, "--start", 1);
    context.setLineDash([4, 3].map((part) => part * devicePixelRatio));
    stroke(rest, "--rest", 1.5);
    context.setLineDash([]);
    stroke(over, this.colour, 1.5);
    stroke(moving, this.colour, 1.5);
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
