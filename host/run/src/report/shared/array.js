// Pixels of an array of columns and rows, which are numbered row by row.

export function pixelName({ columns, sides: [column, row] }, pixel) {
  return `${column} ${pixel % columns}, ${row} ${Math.floor(pixel / columns)}`;
}

/** The pixel at a place of a map of this size, -1 if there is no array. */
export function pixelAt({ columns, rows }, x, y, width, height) {
  if (columns * rows === 0) return -1;
  const at = (offset, size, count) => Math.min(count - 1, Math.max(0, Math.floor((offset / size) * count)));
  return at(y, height, rows) * columns + at(x, width, columns);
}

/** The pixel that is so many columns and rows away, -1 beyond the array. */
export function neighbour(array, pixel, [columns, rows]) {
  const column = (pixel % array.columns) + columns;
  const row = Math.floor(pixel / array.columns) + rows;
  const isThere = column >= 0 && column < array.columns && row >= 0 && row < array.rows;
  return isThere ? row * array.columns + column : -1;
}

/** Whether the block of a level that begins with `first` has the pixel. */
export function holds({ columns }, first, level, pixel) {
  const of = (address) => {
    const row = Math.floor(address / columns);
    return [(address - row * columns) >> level, row >> level];
  };
  const [[column, row], [x, y]] = [of(first), of(pixel)];
  return column === x && row === y;
}

/** Of the pixels that suit, the one closest to a column and row; -1 without any. */
export function closest({ columns, rows }, [column, row], suits) {
  let [found, least] = [-1, Infinity];
  for (let pixel = 0; pixel < columns * rows; pixel++) {
    const distance = Math.hypot((pixel % columns) - column, Math.floor(pixel / columns) - row);
    if (distance < least && suits(pixel)) [found, least] = [pixel, distance];
  }
  return found;
}
