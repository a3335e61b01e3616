// A pad on which an outline is drawn, by mouse, pen or finger.

/** Points left out where the line is straight to within `width`: Ramer, Douglas and Peucker. */
export function simplified(points, width) {
  if (points.length < 3) return points;
  const [[ax, ay], [bx, by]] = [points[0], points.at(-1)];
  const length = Math.hypot(bx - ax, by - ay);
  const away = ([x, y]) => length > 0
    ? Math.abs((x - ax) * (by - ay) - (y - ay) * (bx - ax)) / length
    : Math.hypot(x - ax, y - ay);
  let far = 0;
  points.forEach((point, i) => { if (away(point) > away(points[far])) far = i; });
  if (away(points[far]) <= width) return [points[0], points.at(-1)];
  return [...simplified(points.slice(0, far + 1), width).slice(0, -1), ...simplified(points.slice(far), width)];
}

/** Calls `drawn` with points in the unit square, y upwards, whenever an outline has been drawn. */
export function pad(canvas, drawn) {
  let line = null;
  const at = ({ offsetX, offsetY }) => [offsetX / canvas.clientWidth, 1 - offsetY / canvas.clientHeight];
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    line = [at(event)];
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!line) return;
    line.push(at(event));
    show(canvas, line);
  });
  const end = () => {
    if (line?.length > 5) drawn(simplified(line, 0.004));
    line = null;
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
}

/** Draws an outline on the pad. */
export function show(canvas, points) {
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x * canvas.width, (1 - y) * canvas.height));
  context.closePath();
  context.strokeStyle = getComputedStyle(canvas).getPropertyValue("--cpu");
  context.lineWidth = 2;
  context.stroke();
}
