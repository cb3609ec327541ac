// What hands do on the canvas, as calls: zoom, drag, click, whole; mouse, touch and keys.

const STILL = 4; // pixels: less is a click, more a drag

export function gestures(canvas, { zoom, drag, click, whole }) {
  const down = new Map();
  let far = 0;
  const at = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY * (event.deltaMode ? 20 : 1)), at(event));
  }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button > 0) return;
    if (!down.size) far = 0;
    down.set(event.pointerId, at(event));
    try { canvas.setPointerCapture(event.pointerId); } catch { /* a pointer that a script made up */ }
  });
  canvas.addEventListener("pointermove", (event) => {
    const from = down.get(event.pointerId);
    if (!from) return;
    const to = at(event);
    const step = [to[0] - from[0], to[1] - from[1]];
    far += Math.hypot(...step);
    if (down.size === 1 && far > STILL) drag(step, event.shiftKey);
    if (down.size === 2) pinch(down, event.pointerId, to, zoom, drag);
    down.set(event.pointerId, to);
  });
  const up = (event) => {
    const was = down.delete(event.pointerId);
    if (was && event.type === "pointerup" && far <= STILL && !down.size) click(at(event));
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("dblclick", whole);
  canvas.addEventListener("keydown", (event) => {
    const factor = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (factor) zoom(factor, [canvas.clientWidth / 2, canvas.clientHeight / 2]);
    else if (event.key === "0") whole();
    else return;
    event.preventDefault();
  });
}

// Two fingers: their distance zooms, their middle moves the picture.
function pinch(down, moved, to, zoom, drag) {
  const other = [...down].find(([id]) => id !== moved)[1];
  const from = down.get(moved);
  const wide = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]) || 1;
  drag([0.5 * (to[0] - from[0]), 0.5 * (to[1] - from[1])], true);
  zoom(wide(to) / wide(from), [0.5 * (to[0] + other[0]), 0.5 * (to[1] + other[1])]);
}
