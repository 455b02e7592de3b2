// The strips under the scrub bar: what was measured over time, on the clock of the picture above.
import {el} from './dom';
import {Limits, Scene, Track} from './replay';
import {Happening, PARTED, Trace, baseOf, distancesOf, frameAt, holds, phaseAt, sampleAt, secondsAt, traceOf} from './timeline';

export interface Shown {
  index: number;
  track: Track;
  colour: string;
}

interface Plot {
  context: CanvasRenderingContext2D;
  width: number;
  height: number;
  x: (seconds: number) => number;
  css: (name: string) => string;
}

// One line of a strip: how it is drawn, and what it is.
interface Legend {
  colour: string; // of the style sheet
  dashes: number[];
  text: string;
}

interface Strip {
  name: string;
  height: number;
  draw: (plot: Plot) => void;
  read: (seconds: number) => string; // what the label says at an instant
  legend?: () => Legend[];
}

const DASHES = [[], [5, 3], [2, 2], [8, 3, 2, 3], [1, 3], [9, 4]];

export class Strips {
  readonly element = el('div', {class: 'strips'});
  private readonly cursor = el('div', {class: 'cursor', 'aria-hidden': 'true'});
  private readonly rows: {strip: Strip; canvas: HTMLCanvasElement; value: HTMLElement; row: HTMLElement; legend: HTMLElement}[] = [];
  private readonly traces = new Map<Track, Trace>();
  private shown: Shown[] = [];
  private focus: Shown | null = null;
  private range: [number, number] = [0, 1];
  private happenings: Happening[] = [];
  private partings = new Map<number, number>(); // track index -> seconds

  constructor(private readonly limits: Limits, seek: (seconds: number) => void) {
    for (const strip of [this.phases(), this.margins(), this.forces(), this.distances(), this.heights()]) {
      const canvas = el('canvas', {'aria-hidden': 'true'});
      canvas.style.height = `${strip.height}px`;
      const value = el('span', {class: 'value'});
      const legend = el('ul', {class: 'legend', 'aria-label': `Lines of ${strip.name}`});
      const row = el('div', {class: 'strip'}, el('div', {class: 'label'}, el('b', {}, strip.name), value), canvas, legend);
      this.rows.push({strip, canvas, value, row, legend});
      this.element.append(row);
    }
    this.element.append(this.cursor);
    const point = (event: PointerEvent) => {
      const box = this.rows[0]!.canvas.getBoundingClientRect();
      const part = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
      seek(this.range[0] + part * (this.range[1] - this.range[0]));
    };
    this.element.addEventListener('pointerdown', (event) => {
      if (!(event.target instanceof HTMLCanvasElement)) return;
      this.element.setPointerCapture(event.pointerId);
      point(event);
    });
    this.element.addEventListener('pointermove', (event) => {
      if (this.element.hasPointerCapture(event.pointerId)) point(event);
    });
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  // Seconds at which a shown track's base or a hand is first PARTED metres from the focus's.
  partingsOf(): Map<number, number> { return this.partings; }

  show(scene: Scene, range: [number, number], shown: Shown[], focus: number, happenings: Happening[]): void {
    this.range = range;
    this.shown = shown;
    this.focus = shown.find((one) => one.index === focus) ?? null;
    this.happenings = happenings;
    this.partings = new Map();
    for (const one of shown) {
      const distances = this.distance(one);
      const first = distances.findIndex((d) => d > PARTED);
      if (first >= 0) this.partings.set(one.index, this.secondsOfSample(first));
    }
    const touched = scene.tracks.some((track) => track.contacts.length > 0);
    const rows = new Map(this.rows.map((row) => [row.strip.name, row.row]));
    rows.get('partner force')!.hidden = !touched;
    rows.get('distance')!.hidden = shown.filter((one) => one.track.robot).length < 2 || !this.focus?.track.robot;
    rows.get('detector')!.hidden = !this.focus?.track.detectors[0];
    for (const {strip, legend} of this.rows) {
      const lines = strip.legend?.() ?? [];
      legend.hidden = lines.length === 0;
      legend.replaceChildren(...lines.map((one) => el('li', {}, swatchOf(one), one.text)));
    }
    this.draw();
  }

  move(seconds: number): void {
    const box = this.rows[0]!.canvas, span = this.range[1] - this.range[0] || 1;
    const part = (seconds - this.range[0]) / span;
    this.cursor.style.transform = `translateX(${box.offsetLeft + part * box.clientWidth}px)`;
    for (const {strip, value} of this.rows) {
      const text = strip.read(seconds);
      if (value.textContent !== text) value.textContent = text;
    }
  }

  draw(): void {
    const style = getComputedStyle(this.element);
    for (const {strip, canvas, row} of this.rows) {
      if (row.hidden || canvas.clientWidth === 0) continue;
      const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = strip.height;
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
      const context = canvas.getContext('2d')!;
      context.setTransform(scale, 0, 0, scale, 0, 0);
      context.font = `11px ${style.fontFamily}`;
      const [begin, end] = this.range, span = end - begin || 1;
      strip.draw({context, width, height, x: (s) => ((s - begin) / span) * width,
                  css: (name) => style.getPropertyValue(name).trim()});
    }
  }

  private trace(track: Track): Trace {
    if (!this.traces.has(track)) this.traces.set(track, traceOf(track));
    return this.traces.get(track)!;
  }

  private distance(one: Shown): Float64Array {
    const focus = this.focus;
    if (!focus || focus.track === one.track) return new Float64Array(0);
    return distancesOf(focus.track, this.trace(focus.track), one.track, this.trace(one.track));
  }

  private secondsOfSample(i: number): number {
    return secondsAt(this.focus!.track, i * this.trace(this.focus!.track).step);
  }

  private phases(): Strip {
    return {
      name: 'phase',
      height: 38,
      draw: ({context, width, height, x, css}) => {
        context.fillStyle = css('--faint');
        context.fillRect(0, 0, width, height);
        const track = this.focus?.track;
        if (!track) return;
        const [a, b] = [x(secondsAt(track, track.act[0])), x(secondsAt(track, track.act[1]))];
        context.fillStyle = css('--act');
        context.fillRect(a, 0, b - a, height);
        context.fillStyle = css('--ink');
        for (const [name, from, to] of [['preparation', x(secondsAt(track, 0)), a], ['act', a, b],
                                        ['follow-up', b, x(secondsAt(track, track.frames - 1))]] as const)
          if (to - from > context.measureText(name).width + 8) context.fillText(name, from + 5, 23);
        for (const one of this.happenings) {
          if (one.kind === 'act') continue;
          const colour = this.shown.find((s) => s.index === one.track)?.colour ?? css('--soft');
          context.fillStyle = one.kind === 'end' ? css('--bad') : one.kind === 'verdict' ? css('--good') : colour;
          const at = x(one.seconds);
          context.fillRect(at - 1, one.kind === 'contact' ? height - 7 : 0, 2, one.kind === 'contact' ? 7 : height);
        }
      },
      read: (seconds) => {
        const track = this.focus?.track;
        return track ? phaseAt(track, frameAt(track, seconds)) : '';
      },
    };
  }

  private margins(): Strip {
    return {
      name: 'detector',
      height: 78,
      draw: ({context, width, height, x, css}) => {
        const track = this.focus?.track, detector = track?.detectors[0];
        context.clearRect(0, 0, width, height);
        if (!track || !detector) return;
        const middle = height / 2, y = (v: number) => middle - Math.max(-1, Math.min(1, v)) * (middle - 6);
        for (const [k, change] of detector.evidence.entries()) {
          if (k % 2 === 1) continue;
          const end = detector.evidence[k + 1] ?? track.frames;
          context.fillStyle = css('--evidence');
          context.fillRect(x(secondsAt(track, change)), 0, x(secondsAt(track, end)) - x(secondsAt(track, change)), height);
        }
        axis(context, css, [[middle, 'threshold']], width);
        for (const k of detector.names.keys()) {
          context.setLineDash(DASHES[k % DASHES.length]!);
          line(context, css(`--m${k % 6}`), 1.6, detector.frames.map((f, i) =>
            [x(secondsAt(track, f)), y(detector.margins.values[k * detector.margins.rows + i]!)]));
          context.setLineDash([]);
        }
        const good = holds(detector.success, detector.frames.length - 1);
        context.fillStyle = css(good ? '--good' : '--bad');
        for (const [i, frame] of detector.frames.entries())
          if (holds(detector.success, i))
            context.fillRect(Math.floor(x(secondsAt(track, detector.frames[i - 1] ?? 0))), height - 3,
                             Math.ceil(x(secondsAt(track, frame)) - x(secondsAt(track, detector.frames[i - 1] ?? 0))) + 1, 3);
      },
      legend: () => {
        const detector = this.focus?.track.detectors[0];
        return (detector?.names ?? []).map((name, k) => ({
          colour: `--m${k % 6}`, dashes: DASHES[k % DASHES.length]!,
          text: `${name.replaceAll('_', ' ')}${limitText(detector!.thresholds[k]!, detector!.units[k]!)}`,
        }));
      },
      read: (seconds) => {
        const track = this.focus?.track, detector = track?.detectors[0];
        if (!track || !detector) return 'none';
        const sample = sampleAt(detector.frames, frameAt(track, seconds));
        if (sample < 0) return '';
        let worst = -1, least = Infinity;
        for (const k of detector.names.keys()) {
          if (detector.names.includes('overall') && detector.names[k] !== 'overall') continue;  // the best of several ways
          const margin = detector.margins.values[k * detector.margins.rows + sample]!;
          if (Number.isFinite(margin) && margin < least) [worst, least] = [k, margin];
        }
        if (worst < 0) return holds(detector.success, sample) ? 'detected' : 'not yet detected';
        const threshold = Math.abs(detector.thresholds[worst]!), unit = detector.units[worst]!;
        return `${holds(detector.success, sample) ? 'detected' : 'not yet detected'}; ` +
               `${detector.names[worst]!.replaceAll('_', ' ')} ${signed(least * (threshold || 1))} ${unit}`;
      },
    };
  }

  private limitOf(track: Track): number | null {
    let least: number | null = null;
    for (const contact of track.contacts) {
      const limit = this.limits.regions[track.partner?.capsules[contact.capsule]?.region ?? '']?.newton;
      if (limit !== undefined && (least === null || limit < least)) least = limit;
    }
    return least;
  }

  private forces(): Strip {
    return {
      name: 'partner force',
      height: 70,
      draw: ({context, width, height, x, css}) => {
        context.clearRect(0, 0, width, height);
        const limit = this.focus ? this.limitOf(this.focus.track) : null;
        let most = Math.max(10, ...this.shown.map((one) => one.track.forces.reduce((a, b) => Math.max(a, b), 0)));
        if (limit !== null && limit < 4 * most) most = Math.max(most, limit);
        const y = (v: number) => height - 4 - (v / most) * (height - 16);
        axis(context, css, [[y(0), ''], [y(most), `${most.toFixed(0)} N`]], width);
        if (limit !== null && limit <= most) {
          context.setLineDash([6, 4]);
          line(context, css('--bad'), 1, [[0, y(limit)], [width, y(limit)]]);
          context.setLineDash([]);
          context.fillStyle = css('--bad');
          context.fillText(`least limit touched ${limit.toFixed(0)} N, ${this.limits.mark}`, 60, Math.max(10, y(limit) - 3));
        }
        for (const one of this.inOrder())
          line(context, one.colour, one === this.focus ? 2 : 1.1,
               Array.from(one.track.forces, (f, i) => [x(secondsAt(one.track, i)), y(f)]));
      },
      read: (seconds) => {
        const track = this.focus?.track;
        return track ? `${track.forces[frameAt(track, seconds)]!.toFixed(1)} N` : '';
      },
    };
  }

  private distances(): Strip {
    return {
      name: 'distance',
      height: 62,
      draw: ({context, width, height, x, css}) => {
        context.clearRect(0, 0, width, height);
        const all = this.inOrder().map((one) => [one, this.distance(one)] as const);
        const most = Math.max(0.1, ...all.map(([, d]) => d.reduce((a, b) => (b > a ? b : a), 0)));
        const y = (v: number) => height - 4 - (v / most) * (height - 16);
        axis(context, css, [[y(0), ''], [y(most), `${most.toFixed(2)} m`], [y(PARTED), '']], width);
        for (const [one, distances] of all) {
          line(context, one.colour, 1.4, Array.from(distances, (d, i) => [x(this.secondsOfSample(i)), y(d)]));
          const parted = this.partings.get(one.index);
          if (parted === undefined) continue;
          context.fillStyle = one.colour;
          context.beginPath();
          context.arc(x(parted), y(PARTED), 3.4, 0, 2 * Math.PI);
          context.fill();
        }
      },
      read: () => {
        const first = Math.min(...this.partings.values());
        return Number.isFinite(first) ? `parts from ${this.focus!.track.row?.engine ?? 'it'} at ${(first - this.range[0]).toFixed(1)} s`
                                      : 'stay within 5 cm';
      },
    };
  }

  private heights(): Strip {
    return {
      name: 'base height',
      height: 46,
      draw: ({context, width, height, x, css}) => {
        context.clearRect(0, 0, width, height);
        const y = (v: number) => height - 3 - Math.min(1.05, Math.max(0, v / 1.0)) * (height - 12);
        axis(context, css, [[y(0), ''], [y(1), '1 m']], width);
        for (const one of this.inOrder()) {
          const {values, rows} = baseOf(one.track);
          const points: [number, number][] = [];
          for (let t = 0; t < rows; t += 3) points.push([x(secondsAt(one.track, t)), y(values[2 * rows + t]!)]);
          line(context, one.colour, one === this.focus ? 2 : 1.1, points);
          if (one.track.outcome === 'ok') continue;
          const at = x(secondsAt(one.track, rows - 1)), top = 7;
          line(context, css('--bad'), 2, [[at - 4, top - 4], [at + 4, top + 4]]);
          line(context, css('--bad'), 2, [[at - 4, top + 4], [at + 4, top - 4]]);
        }
      },
      read: (seconds) => {
        const track = this.focus?.track;
        if (!track) return '';
        const {values, rows} = baseOf(track);
        return `${values[2 * rows + frameAt(track, seconds)]!.toFixed(2)} m`;
      },
    };
  }

  private inOrder(): Shown[] {
    return [...this.shown.filter((one) => one !== this.focus), ...(this.focus ? [this.focus] : [])];
  }
}

// A short piece of the line, as it is drawn.
function swatchOf({colour, dashes}: Legend): SVGElement {
  const space = 'http://www.w3.org/2000/svg', svg = document.createElementNS(space, 'svg'), line = document.createElementNS(space, 'line');
  for (const [name, value] of Object.entries({width: '26', height: '8', 'aria-hidden': 'true'})) svg.setAttribute(name, value);
  for (const [name, value] of Object.entries({x1: '0', x2: '26', y1: '4', y2: '4', 'stroke-width': '2', 'stroke-dasharray': dashes.join(' ')}))
    line.setAttribute(name, value);
  line.style.stroke = `var(${colour})`;
  svg.append(line);
  return svg;
}

// " (limit 0.3 m)"; a margin of the best of several ways has no limit of its own.
function limitText(threshold: number, unit: string): string {
  return unit ? ` (limit ${Number(Math.abs(threshold).toPrecision(3))} ${unit})` : '';
}

function signed(value: number): string { return `${value >= 0 ? '+' : '−'}${Math.abs(value).toPrecision(3)}`; }

function axis(context: CanvasRenderingContext2D, css: (name: string) => string, lines: [number, string][],
              width: number): void {
  for (const [y, text] of lines) {
    context.fillStyle = css('--line');
    context.fillRect(0, Math.round(y), width, 1);
    context.fillStyle = css('--soft');
    if (text) context.fillText(text, 4, Math.max(10, y - 3));
  }
}

function line(context: CanvasRenderingContext2D, colour: string, width: number, points: [number, number][]): void {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  let drawing = false;
  for (const [x, y] of points) {
    if (!Number.isFinite(y)) drawing = false;
    else if (drawing) context.lineTo(x, y);
    else context.moveTo(x, y);
    drawing = Number.isFinite(y);
  }
  context.stroke();
}
