// From columns, rows and laser cycles to the screen: a box that turns, without perspective.

const VIEWS = {
  reset: { yaw: 0.75, pitch: 0.4, zoom: 1 },
  front: { yaw: 0, pitch: 0, zoom: 1 }, // columns and rows
  side: { yaw: Math.PI / 2, pitch: 0, zoom: 1 }, // third axis and rows
  top: { yaw: Math.PI / 2, pitch: Math.PI / 2, zoom: 1 }, // third axis and columns
};
const view = { ...VIEWS.reset, third: "range" };

function turn(yaw, pitch) {
  view.yaw += yaw;
  view.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, view.pitch + pitch));
}

function enlarge(factor) {
  view.zoom = Math.min(20, Math.max(0.5, view.zoom * factor));
}

/** The three sides of the box: what they count, and how long they are. */
function axes() {
  const longest = Math.max(data.columns, data.rows);
  const side = (count) => Math.max(0.3, count / longest);
  const third = view.third === "range"
    ? { name: "range, mm", ...spanOfRange(), length: 1 }
    : { name: `time, ${clock.unit}`, low: shown.start, high: shown.end, per: clock.per, length: 1.3 };
  return [
    { name: data.sides[0], low: -0.5, high: data.columns - 0.5, length: side(data.columns), whole: true },
    { name: data.sides[1], low: -0.5, high: data.rows - 0.5, length: side(data.rows), whole: true },
    third,
  ];
}

/** All ranges: only colours end at percentiles. */
function spanOfRange() {
  const room = farthest > nearest ? 0 : 0.5;
  return { low: nearest - room, high: farthest + room };
}

/** What turns places in the box, its middle the origin, into places on the screen. */
function camera([across, down, along], width, height) {
  const { yaw, pitch, zoom } = view;
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
    project(x, y, z) {
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
function eachPlace(sides, { rows }, visit, first = shown.first, last = shown.last) {
  const [across, down, along] = sides;
  const [toX, toY, toDepth] = rows;
  const third = view.third === "range" ? events.range : events.cycle;
  for (let event = first; event < last; event++) {
    if (events.range[event] > shown.far) continue;
    const pixel = events.pixel[event];
    const row = Math.floor(pixel / data.columns);
    const column = pixel - row * data.columns;
    const side = 1 << events.level[event];
    const wide = Math.min(side, data.columns - column);
    const high = Math.min(side, data.rows - row);
    const x = ((column + 0.5 * wide) / data.columns - 0.5) * across.length;
    const y = ((row + 0.5 * high) / data.rows - 0.5) * down.length;
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
