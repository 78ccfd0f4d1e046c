// From columns, rows and laser cycles to the screen: a box that turns, without perspective.

import { share } from "./numbers.js";

/** The three sides of the box: what they count, and how long they are. */
export function axes(scene) {
  const { columns, rows, sides, view, shown, clock } = scene;
  const longest = Math.max(columns, rows);
  const side = (count) => Math.max(0.3, count / longest);
  const third = view.third === "range"
    ? { name: "range, mm", ...spanOfRange(scene), length: 1 }
    : { name: `time, ${clock.unit}`, low: shown.start, high: shown.end, per: clock.per, length: 1.3 };
  return [
    { name: sides[0], low: -0.5, high: columns - 0.5, length: side(columns), whole: true },
    { name: sides[1], low: -0.5, high: rows - 0.5, length: side(rows), whole: true },
    third,
  ];
}

/** All ranges: only colours end at percentiles. */
function spanOfRange({ nearest, farthest }) {
  const room = farthest > nearest ? 0 : 0.5;
  return { low: nearest - room, high: farthest + room };
}

/** What turns places in the box, its middle the origin, into places on the screen. */
export function camera([across, down, along], { yaw, pitch, zoom }, width, height) {
  const [cosYaw, sinYaw, cosPitch, sinPitch] =
    [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  // As large as the whole box is seen, whichever way it is turned.
  const seen = (a, b) => across.length * Math.abs(a) + along.length * Math.abs(b);
  const wide = seen(cosYaw, sinYaw);
  const high = down.length * cosPitch + seen(sinYaw, cosYaw) * Math.abs(sinPitch);
  const fit = Math.min((width - 130) / wide, (height - 90) / high);
  const scale = Math.max(40, fit) * zoom;
  return {
    scale,
    project: (x, y, z) => {
      const near = z * cosYaw - x * sinYaw;
      return {
        x: width / 2 + scale * (x * cosYaw + z * sinYaw),
        y: height / 2 - 8 + scale * (y * cosPitch - near * sinPitch),
        depth: y * sinPitch + near * cosPitch,
      };
    },
    // The same as coefficients, for many: x to the right, y down, depth away.
    rows: [
      [scale * cosYaw, 0, scale * sinYaw, width / 2],
      [scale * sinYaw * sinPitch, scale * cosPitch, -scale * cosYaw * sinPitch, height / 2 - 8],
      [-sinYaw * cosPitch, sinPitch, cosYaw * cosPitch, 0],
    ],
  };
}

/**
 * Calls visit(event, x, y, depth, wide, high) for those from first to before last that are
 * shown: the middle of what each stands for, and how many columns and rows that has.
 */
export function eachPlace(scene, sides, eye, visit, first = scene.shown.first, last = scene.shown.last) {
  const { columns, rows, events, view, shown } = scene;
  const [across, down, along] = sides;
  const [toX, toY, toDepth] = eye.rows;
  const third = view.third === "range" ? events.range : events.cycle;
  for (let event = first; event < last; event++) {
    if (events.range[event] > shown.far) continue;
    const pixel = events.pixel[event];
    const row = Math.floor(pixel / columns);
    const column = pixel - row * columns;
    const side = 1 << events.level[event];
    const wide = Math.min(side, columns - column);
    const high = Math.min(side, rows - row);
    const x = ((column + 0.5 * wide) / columns - 0.5) * across.length;
    const y = ((row + 0.5 * high) / rows - 0.5) * down.length;
    const z = (share(third[event], along.low, along.high) - 0.5) * along.length;
    visit(
      event,
      toX[0] * x + toX[1] * y + toX[2] * z + toX[3],
      toY[0] * x + toY[1] * y + toY[2] * z + toY[3],
      toDepth[0] * x + toDepth[1] * y + toDepth[2] * z,
      wide,
      high,
    );
  }
}

/** The side of an event's rectangle on the screen that stands for so many pixels. */
export function pointSize({ columns, view }, sides, eye, count = 1) {
  const cell = (eye.scale * sides[0].length) / columns;
  // Surfaces are closed where the third axis is the range.
  const part = view.third === "range" ? 0.9 : 0.55;
  return count * Math.min(10, Math.max(2, part * cell));
}

/** The event that is seen at a place of a cloud of this size, -1 if there is none. */
export function eventAt(scene, x, y, width, height) {
  const sides = axes(scene);
  const eye = camera(sides, scene.view, width, height);
  const size = pointSize(scene, sides, eye);
  const reach = Math.max(6, size);
  let [found, best] = [-1, Infinity];
  eachPlace(scene, sides, eye, (event, atX, atY, depth, wide, high) => {
    // From the nearest pixel of a block.
    const beyond = (off, count) => Math.max(0, Math.abs(off) - ((count - 1) * size) / 2);
    const away = Math.max(beyond(atX - x, wide), beyond(atY - y, high));
    // The nearer of two, unless the pointer is closer to the other.
    const cost = away + 10 * depth;
    if (away <= reach && cost < best) [found, best] = [event, cost];
  });
  return found;
}
