// A line plot that the program declares (report/tables/line_plot.h), drawn as an SVG that the style sheet colours.
import {svg} from './dom';

export interface Plot {
  title: string;
  x_label: string;
  y_label: string;
  loss: boolean; // terms that fall: logarithmic where they span much, with the values at the end beside them
  series: {name: string; x?: number[]; y: (number | null)[]}[]; // x: that of the series before where it is absent
}

interface Curve {
  name: string;
  points: [number, number | null][];
  last: number;
}

const LEFT = 62, TOP = 26, BOTTOM = 190, WIDTH = 600, KEY_LINE = 17, COLOURS = 9;
const RIGHT = 584, LOSS_RIGHT = 420; // a loss has its key at the right
const LOGARITHMIC_SPAN = 20, MOST_DECADES = 6;

// One axis, of values or of their decimal logarithms.
export class Axis {
  low = Infinity;
  high = -Infinity;
  private step = 1; // between ticks

  constructor(private readonly from: number, private readonly to: number, readonly logarithmic = false) {}

  private drawn(value: number): number { return this.logarithmic ? Math.log10(value) : value; }

  take(value: number): void {
    this.low = Math.min(this.low, this.drawn(value));
    this.high = Math.max(this.high, this.drawn(value));
  }

  // Rounds to the next tick on either side, with at most so many intervals; with room where all values are one.
  round(intervals: number): void {
    if (this.logarithmic) {
      this.low = Math.floor(this.low);
      this.high = Math.max(Math.ceil(this.high), this.low + 1);
      this.step = Math.max(1, Math.ceil((this.high - this.low) / intervals));
      return;
    }
    if (this.high - this.low <= 1e-12 * Math.max(Math.abs(this.high), Math.abs(this.low))) {
      const room = this.high === 0 ? 1 : 0.1 * Math.abs(this.high);
      this.low -= room;
      this.high += room;
    }
    this.step = niceStep((this.high - this.low) / intervals);
    this.low = Math.floor(this.low / this.step + 1e-9) * this.step;
    this.high = Math.ceil(this.high / this.step - 1e-9) * this.step;
  }

  at(value: number): number { return this.from + (this.to - this.from) * (this.drawn(value) - this.low) / (this.high - this.low); }

  ticks(): number[] {
    const count = Math.floor((this.high - this.low) / this.step + 1e-9) + 1;
    return Array.from({length: count}, (_, i) => this.low + i * this.step).map((at) => this.logarithmic ? 10 ** at : at);
  }

  label(tick: number): string {
    const size = Math.abs(tick);
    if (this.logarithmic) {
      const decade = Math.round(Math.log10(tick));
      return Math.abs(decade) <= 3 ? String(Number((10 ** decade).toPrecision(1))) : `1e${decade}`;
    }
    if (size < 1e-9 * this.step) return '0';
    if (size >= 1e6) return `${Number((tick / 1e6).toPrecision(6))}M`;
    if (size >= 1e4) return `${Number((tick / 1e3).toPrecision(6))}k`;
    return tick.toFixed(Math.min(20, Math.max(0, -Math.floor(Math.log10(this.step) + 1e-9))));
  }
}

// The next of 1, 2 and 5 times a power of ten.
export function niceStep(raw: number): number {
  const decade = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((factor) => factor * decade).find((step) => step >= raw * (1 - 1e-9)) ?? 10 * decade;
}

export function curvesOf(plot: Plot): Curve[] {
  let x: number[] = [];
  const curves = plot.series.map((series) => {
    x = series.x ?? x;
    return {name: series.name, points: x.map((at, i): [number, number | null] => [at, series.y[i] ?? null]),
            last: series.y.filter((y) => y !== null).at(-1) ?? NaN};
  });
  // The total first, then as they lie over one another at the right.
  const rank = (curve: Curve) => ['total', 'loss'].includes(curve.name) ? -Infinity : -curve.last;
  return plot.loss ? curves.sort((a, b) => rank(a) - rank(b)) : curves;
}

function valuesOf(curves: Curve[]): number[] { return curves.flatMap((c) => c.points.flatMap(([, y]) => y === null ? [] : [y])); }

export function heightAxis(plot: Plot, curves: Curve[]): Axis {
  const values = valuesOf(curves), high = Math.max(...values);
  // Terms that fall to nothing must not stretch the axis over dozens of decades.
  const positive = Math.max(Math.min(...values.filter((y) => y > 0)), high * 1e-6);
  const logarithmic = plot.loss && Math.min(...values) >= 0 && high > LOGARITHMIC_SPAN * positive;
  const axis = new Axis(BOTTOM, TOP, logarithmic);
  for (const value of logarithmic ? [positive, high] : values) axis.take(value);
  if (plot.loss && !logarithmic) axis.take(0);
  axis.round(logarithmic ? MOST_DECADES : 5);
  return axis;
}

// Interrupted where there is no value, or none that the axis has; one point alone is a dot.
export function pathOf(curve: Curve, x: Axis, y: Axis): string {
  let path = '', down = false;
  for (const [at, value] of curve.points) {
    const shown = value !== null && (!y.logarithmic || value > 0);
    if (shown) {
      const point = `${x.at(at).toFixed(1)} ${Math.min(y.at(value), BOTTOM).toFixed(1)}`;
      path += down ? `L${point}` : `M${point}L${point}`;
    }
    down = shown;
  }
  return path;
}

function text(x: number, y: number, anchor: string, content: string, cls = ''): SVGElement {
  return svg('text', {x: x.toFixed(1), y: y.toFixed(1), 'text-anchor': anchor, class: cls}, content);
}

function grid(plot: Plot, x: Axis, y: Axis, right: number): SVGElement[] {
  return [
    ...y.ticks().flatMap((tick) => [svg('line', {class: 'grid', x1: LEFT, x2: right, y1: y.at(tick), y2: y.at(tick)}),
                                    text(LEFT - 7, y.at(tick) + 4, 'end', y.label(tick))]),
    svg('line', {class: 'axis', x1: LEFT, x2: right, y1: BOTTOM, y2: BOTTOM}),
    ...x.ticks().map((tick) => text(x.at(tick), BOTTOM + 17, 'middle', x.label(tick))),
    text((LEFT + right) / 2, BOTTOM + 35, 'middle', plot.x_label),
    text(LEFT, 14, 'start', plot.y_label + (y.logarithmic ? ' (logarithmic)' : '')),
  ];
}

function short(value: number): string { return String(Number(value.toPrecision(3))); }

// The line of a curve and its entry in the key: beside a loss, else below, three a line; none where the axis names it.
function drawnCurve(plot: Plot, curve: Curve, i: number, count: number, x: Axis, y: Axis): SVGElement[] {
  const style = `stroke:var(--t${i % COLOURS})` + (plot.loss && i === 0 ? ';stroke-width:2.6' : '');
  const dash = ['', '6 3', '1.5 3'][Math.min(2, Math.floor(i / COLOURS))]!;
  const line = svg('path', {d: pathOf(curve, x, y), style, 'stroke-dasharray': dash}, svg('title', {}, curve.name));
  if (count < 2 && !plot.loss) return [line];
  const left = plot.loss ? LOSS_RIGHT + 14 : 180 + 140 * (i % 3), at = plot.loss ? 28 + KEY_LINE * i : 236 + KEY_LINE * Math.floor(i / 3);
  const key = [line, svg('path', {d: `M${left} ${at - 4}h18`, style, 'stroke-dasharray': dash}), text(left + 24, at, 'start', curve.name, 'key')];
  return plot.loss ? [...key, text(WIDTH - 4, at, 'end', short(curve.last))] : key;
}

// What a reader who does not see it is told.
function summaryOf(plot: Plot, curves: Curve[]): string {
  const parts = curves.map((curve) => {
    const values = valuesOf([curve]);
    return `${curve.name} from ${short(values[0]!)} to ${short(curve.last)}, between ${short(Math.min(...values))} and ${short(Math.max(...values))}`;
  });
  return `${plot.title}; ${plot.y_label} over ${plot.x_label}: ${parts.join('; ')}`;
}

export function drawn(plot: Plot): SVGElement {
  const curves = curvesOf(plot), right = plot.loss ? LOSS_RIGHT : RIGHT;
  const x = new Axis(LEFT, right), y = heightAxis(plot, curves);
  for (const [at] of curves.flatMap((curve) => curve.points.filter(([, value]) => value !== null))) x.take(at);
  x.round(6);
  const lines = plot.loss ? Math.max(232, 28 + KEY_LINE * curves.length) : curves.length < 2 ? 232 : 230 + KEY_LINE * Math.ceil(curves.length / 3);
  const all = curves.map((curve, i) => drawnCurve(plot, curve, i, curves.length, x, y)).reverse(); // the first is drawn over the others
  return svg('svg', {class: 'plot', viewBox: `0 0 ${WIDTH} ${lines}`, role: 'img', 'aria-label': summaryOf(plot, curves)},
             ...grid(plot, x, y, right), ...(plot.loss ? [text(WIDTH - 4, 11, 'end', 'at the end')] : []), ...all.flat());
}
