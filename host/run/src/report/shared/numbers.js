// Numbers: scales and texts.

/** Where a value lies between low and high: 0 to 1. */
export function share(value, low, high) {
  return (value - low) / (high - low);
}

/** The place of a value in the colours: 0 at low and below, 255 at high and above. */
export function level(value, low, high) {
  return high > low ? 255 * Math.min(1, Math.max(0, share(value, low, high))) + 0.5 : 127;
}

/** The unit that suits so many laser cycles, and how many it has; laser cycles if the rate is unknown. */
export function timeUnit(cycles, laserHz) {
  if (!laserHz) return { unit: "laser cycle", per: 1, isWhole: true };
  const units = [["s", 1], ["ms", 1e-3], ["µs", 1e-6]];
  const [unit, seconds] = units.find(([, seconds]) => cycles / laserHz >= seconds) ?? units.at(-1);
  return { unit, per: seconds * laserHz, isWhole: false };
}

/** Round values from low to high, at most `most` of them. */
export function ticks(low, high, most, whole) {
  const least = (high - low) / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(least));
  let step = power * [1, 2, 5, 10].find((factor) => factor * power >= least * 0.999);
  if (whole) step = Math.max(1, Math.round(step));
  const values = [];
  for (let at = Math.ceil(low / step) + 0; at * step <= high; at++) values.push(at * step + 0); // never −0
  return values;
}

export function number(value, digits = 0) {
  return value.toLocaleString("en", { maximumFractionDigits: digits });
}

/** With so many digits, so that a column of them is in line. */
export function fixed(value, digits) {
  return value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
}

export function capital(word) {
  return word[0].toUpperCase() + word.slice(1);
}
