// The range of each pixel at a time: that of its last event until then.

/** Which events are in the map so far, and when each pixel was reported last, by level. */
export function emptyMap({ columns, rows }) {
  const count = columns * rows;
  return { events: 0, range: new Float32Array(count).fill(NaN), ends: new Float64Array(4 * count) };
}

/** Takes the events before `end` into the map, later echoes as well if they are `everyEcho`. */
export function mapUntil(map, array, events, end, everyEcho) {
  if (end < map.events) {
    map.events = 0;
    map.ends.fill(0);
    map.range.fill(NaN);
  }
  for (; map.events < end; map.events++) {
    if (events.echo[map.events] === 1 || everyEcho) mapEvent(map, array, events, map.events);
  }
}

/** An event holds for its pixel, one of a block for those that had no better one in its exposure. */
function mapEvent(map, { columns, rows }, events, event) {
  const [level, side] = [events.level[event], 1 << events.level[event]];
  const [left, top] = [events.pixel[event] % columns, Math.floor(events.pixel[event] / columns)];
  const end = events.cycle[event] + 1;
  for (let row = top; row < Math.min(rows, top + side); row++) {
    for (let column = left; column < Math.min(columns, left + side); column++) {
      const pixel = row * columns + column;
      const ends = map.ends.subarray(4 * pixel, 4 * pixel + 4);
      if (ends.subarray(0, level).some((finer) => finer > end - events.exposure[event])) continue;
      ends[level] = end;
      map.range[pixel] = events.range[event];
    }
  }
}
