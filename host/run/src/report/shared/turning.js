// The view of the cloud, and what turns it: fingers and keys.

const VIEWS = {
  reset: { yaw: 0.75, pitch: 0.4, zoom: 1 },
  front: { yaw: 0, pitch: 0, zoom: 1 }, // columns and rows
  side: { yaw: Math.PI / 2, pitch: 0, zoom: 1 }, // third axis and rows
  top: { yaw: Math.PI / 2, pitch: Math.PI / 2, zoom: 1 }, // third axis and columns
};

export function newView() {
  return { ...VIEWS.reset, third: "range" };
}

export function look(view, name) {
  Object.assign(view, VIEWS[name]);
}

export function turn(view, yaw, pitch) {
  view.yaw += yaw;
  view.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, view.pitch + pitch));
}

export function enlarge(view, factor) {
  view.zoom = Math.min(20, Math.max(0.5, view.zoom * factor));
}

const TURNS = {
  ArrowLeft: (view) => turn(view, 0.1, 0),
  ArrowRight: (view) => turn(view, -0.1, 0),
  ArrowUp: (view) => turn(view, 0, -0.1),
  ArrowDown: (view) => turn(view, 0, 0.1),
  "+": (view) => enlarge(view, 1.2),
  "=": (view) => enlarge(view, 1.2),
  "-": (view) => enlarge(view, 1 / 1.2),
  0: (view) => look(view, "reset"),
};

/** Turns the view by a key. Returns whether it is a key that turns. */
export function press(view, key) {
  const isTurn = Object.hasOwn(TURNS, key);
  if (isTurn) TURNS[key](view);
  return isTurn;
}

/**
 * Moves one of the fingers, `[x, y]` by number: a single one turns, two change the size. Returns how far it
 * has moved.
 */
export function drag(view, fingers, id, [x, y]) {
  const before = fingers.get(id);
  if (fingers.size === 1) {
    turn(view, (before[0] - x) / 150, (y - before[1]) / 150);
  } else {
    const [, other] = [...fingers].find(([finger]) => finger !== id);
    const away = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]) + 1;
    enlarge(view, away([x, y]) / away(before));
  }
  fingers.set(id, [x, y]);
  return Math.hypot(x - before[0], y - before[1]);
}
