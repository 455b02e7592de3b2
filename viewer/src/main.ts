// The page: reads its data, puts a picture, strips and panels together, and keeps one clock.
import './style.css';
import {Camera, View, project, steer} from './camera';
import {button, el} from './dom';
import {episodesPanel, keysPanel, tracksPanel, verdictPanel, wordOf} from './panels';
import {Replay, Scene, Track, readReplay} from './replay';
import {Renderer, rgb, themeOf} from './renderer';
import {Actor} from './stage';
import {readState, writeState} from './state';
import {Shown, Strips} from './strips';
import {Happening, endOf, frameAt, happeningsOf, pairOf, phaseAt, rangeOf, secondsAt} from './timeline';

const PALETTE = ['#0072b2', '#e07000', '#009e73', '#cc5fa0', '#8a6fd1', '#4fa8dd', '#a88600', '#7a8b2d'];
const NULL_COLOUR = '#8b9199';
const SPEEDS = [1, 0.5, 0.2, 0.1];
const begun = performance.now();

class Page {
  private scene!: Scene;
  private sceneIndex = -1;
  private actors: Actor[] = [];
  private colours: string[] = [];
  private visible = new Set<number>();
  private focus = 0;
  private range: [number, number] = [0, 1];
  private happenings: Happening[] = [];
  private seconds = 0;
  private playing = false;
  private loop: [number, number] | null = null; // the act, over and over, until somebody does something
  private speed = 1;
  private grid = false;
  private reference = false;
  private hold = false;
  private dirty = true;
  private scale = 1; // of pixels, while something moves
  private sharp = false; // the picture stands and is drawn with all its pixels
  private movedAt = 0;
  private last = 0;
  private frames: number[] = []; // of the picture, their times [ms]
  private readonly camera = new Camera();
  private cameraMoved = false;
  private readonly renderer: Renderer | null;
  private readonly strips: Strips;
  private readonly canvas = el('canvas', {'aria-label': 'The robot and its partner in 3-D. Drag turns, wheel zooms.', role: 'img'});
  private readonly overlay = el('div', {class: 'overlay', 'aria-hidden': 'true'});
  private readonly side = el('aside', {});
  private readonly slider = el('input', {type: 'range', class: 'slider', min: '0', max: '1', step: '0.02', 'aria-label': 'Time'});
  private readonly clock = el('output', {class: 'clock'});
  private readonly play = button('▶', 'Play or pause', () => this.setPlaying(!this.playing), 'space');
  private readonly speedButton = button('1×', 'Speed 1×', () => this.slower(), 'S');
  private readonly gridButton = button('Side by side', 'Ghosts or side by side', () => this.toggle('grid'), 'G');
  private readonly referenceButton = button('Reference', 'Show the reference that the controller follows', () => this.toggle('reference'), 'R');
  private readonly holdButton = button('Hold peaks', 'Keep the largest force on each part of the partner', () => this.toggle('hold'), 'H');
  private readonly keys = keysPanel();

  constructor(private readonly replay: Replay, private readonly app: HTMLElement) {
    this.renderer = this.makeRenderer();
    this.strips = new Strips(replay.limits, (seconds) => this.goTo(seconds));
    const stage = el('div', {class: 'stage'}, this.renderer ? this.canvas : el('p', {class: 'nogl', role: 'alert'},
      'This browser has no WebGL2, so there is no picture in 3-D. The strips below and the table at the end stay.'), this.overlay);
    const bar = el('div', {class: 'bar', role: 'toolbar', 'aria-label': 'Playback'}, this.play,
                   button('|◀', 'Event before', () => this.jump(-1), '['), button('▶|', 'Next event', () => this.jump(1), ']'),
                   this.speedButton, this.clock, el('span', {class: 'gap'}), this.gridButton, this.referenceButton, this.holdButton,
                   button('?', 'Keys', () => this.keys.showModal(), '?'));
    app.append(el('div', {class: 'main'}, stage, bar, el('div', {class: 'slide'}, this.slider), this.strips.element), this.side, this.keys);
    this.slider.addEventListener('input', () => this.goTo(Number(this.slider.value)));
    window.addEventListener('keydown', (event) => this.key(event));
    window.addEventListener('hashchange', () => this.restore(location.hash));
    new ResizeObserver(() => { this.dirty = true; }).observe(stage);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { this.strips.draw(); this.dirty = true; });
    steer(this.camera, this.canvas, () => this.moved(), () => this.save());
    const hash = location.hash;  // before opening an episode writes its own
    this.open(0);
    this.restore(hash);
    if (readState(hash).seconds === undefined && !matchMedia('(prefers-reduced-motion: reduce)').matches) this.playAct();
    requestAnimationFrame((now) => this.tick(now));
  }

  private makeRenderer(): Renderer | null {
    try {
      const renderer = new Renderer(this.canvas);
      if (renderer.software) this.scale = 0.75;
      return renderer;
    } catch (error) {
      console.warn(`no picture in 3-D: ${String(error)}`);
      return null;
    }
  }

  // --- what is shown

  private open(index: number): void {
    const scene = this.replay.scenes[index];
    if (!scene || index === this.sceneIndex) return;
    const before = this.scene?.tracks[this.focus]?.name;
    this.sceneIndex = index;
    this.scene = scene;
    this.actors = scene.tracks.map((track) => new Actor(track, this.replay.limits));
    this.range = rangeOf(scene.tracks);
    const same = scene.tracks.findIndex((track) => track.name === before);
    this.focus = Math.max(0, same);
    this.choose(scene.tracks.some((track) => track.row) ? 'engines' : 'all');
    this.frameCamera();
    this.seek(Math.max(this.range[0], Math.min(0, this.range[1])));
  }

  private choose(which: 'engines' | 'policies' | 'all' | 'one'): void {
    const row = this.scene.tracks[this.focus]!.row;
    this.visible = new Set(this.scene.tracks.map((_, i) => i).filter((i) => {
      const other = this.scene.tracks[i]!.row;
      if (i === this.focus || which === 'all') return true;
      if (which === 'one' || !row || !other || row.arm !== other.arm) return false;
      return which === 'engines' ? row.policy === other.policy && row.controller === other.controller && other.engine !== 'playback'
                                 : row.engine === other.engine && row.controller === other.controller;
    }));
    this.refresh();
  }

  // By what tells the shown tracks apart: engines, else policies, else their order.
  private colour(): void {
    const shown = [...this.visible].sort((a, b) => a - b), tracks = this.scene.tracks;
    const keys = [(t: Track) => t.row?.engine ?? '', (t: Track) => t.row?.policy ?? '', (t: Track) => t.name];
    const main = shown.filter((i) => tracks[i]!.row?.arm !== 'null');
    const key = keys.find((of) => new Set(main.map((i) => of(tracks[i]!))).size === main.length) ?? keys[2]!;
    const names = [...new Set(tracks.map(key))];
    this.colours = tracks.map((track) => track.row?.arm === 'null' ? NULL_COLOUR : PALETTE[names.indexOf(key(track)) % PALETTE.length]!);
  }

  private refresh(): void {
    this.visible.add(this.focus);
    this.colour();
    this.range = rangeOf([...this.visible].map((i) => this.scene.tracks[i]!));
    this.slider.min = String(this.range[0]);
    this.slider.max = String(this.range[1]);
    const shown: Shown[] = [...this.visible].sort((a, b) => a - b).map((index) =>
      ({index, track: this.scene.tracks[index]!, colour: this.colours[index]!}));
    this.happenings = happeningsOf(this.scene.tracks[this.focus]!, this.focus);
    for (const one of shown)
      if (one.index !== this.focus)
        this.happenings.push(...happeningsOf(one.track, one.index).filter((h) => h.kind === 'end'));
    this.strips.show(this.scene, this.range, shown, this.focus, this.happenings);
    for (const [index, seconds] of this.strips.partingsOf())
      this.happenings.push({seconds, kind: 'parted', track: index, text: `${this.scene.tracks[index]!.name} parts`});
    this.happenings.sort((a, b) => a.seconds - b.seconds);
    const choice = {colours: this.colours, visible: this.visible, focus: this.focus};
    const active = document.activeElement?.getAttribute('aria-label') ?? document.activeElement?.textContent;
    this.side.replaceChildren(
      verdictPanel(this.scene.tracks[this.focus]!, this.scene.task),
      tracksPanel(this.scene, choice, (i) => this.toggleTrack(i), (i) => this.setFocus(i), (which) => this.choose(which)),
      episodesPanel(this.replay, this.sceneIndex, (i) => this.open(i)));
    if (active && document.activeElement === document.body)
      for (const one of this.side.querySelectorAll<HTMLElement>('button, input'))
        if ((one.getAttribute('aria-label') ?? one.textContent) === active) one.focus();
    this.showTitle();
    this.press(this.gridButton, this.grid);
    this.press(this.referenceButton, this.reference);
    this.press(this.holdButton, this.hold);
    this.seek(this.seconds);
    this.save();
  }

  // "Hug, hug_000: success" before the run's name.
  private showTitle(): void {
    const track = this.scene.tracks[this.focus]!, task = this.scene.task.replaceAll('_', ' ');
    const what = [task && `${task[0]!.toUpperCase()}${task.slice(1)}`, this.scene.name].filter((part) => part).join(', ');
    const text = track.row ? `${what}: ${wordOf(track)}` : what;
    document.querySelector('#head h1')?.replaceChildren(text, el('small', {}, `${track.name} · ${this.replay.title}`));
    document.title = `${text} - ${this.replay.title}`;
  }

  private press(of: HTMLElement, on: boolean): void { of.setAttribute('aria-pressed', String(on)); }

  private toggleTrack(i: number): void {
    if (this.visible.has(i) && i !== this.focus) this.visible.delete(i);
    else this.visible.add(i);
    this.refresh();
  }

  private setFocus(i: number): void {
    this.focus = (i + this.scene.tracks.length) % this.scene.tracks.length;
    this.refresh();
  }

  private toggle(what: 'grid' | 'reference' | 'hold'): void {
    this[what] = !this[what];
    this.refresh();
  }

  private toggleNull(): void {
    const row = this.scene.tracks[this.focus]!.row;
    const arm = this.scene.tracks.findIndex((track) => track.row?.arm === 'null' && track.row.engine === row?.engine &&
                                                       track.row.controller === row?.controller);
    if (arm >= 0) this.toggleTrack(arm);
  }

  // --- time

  private seek(seconds: number): void {
    this.seconds = Math.min(this.range[1], Math.max(this.range[0], seconds));
    this.slider.value = String(this.seconds);
    const track = this.scene.tracks[this.focus]!, frame = frameAt(track, this.seconds);
    const text = `${(this.seconds - this.range[0]).toFixed(2)} s, frame ${frame}`;
    this.clock.textContent = text;
    this.app.dataset.frame = String(frame);
    this.app.dataset.force = track.forces[frame]?.toFixed(1) ?? '';
    this.slider.setAttribute('aria-valuetext', `${text}, ${phaseAt(track, frame)}`);
    this.strips.move(this.seconds);
    this.dirty = true;
    if (!this.playing) this.save();
  }

  private goTo(seconds: number): void {
    this.endLoop();
    this.seek(seconds);
  }

  private playAct(): void {
    const track = this.scene.tracks[this.focus]!, pause = 0.4;
    this.loop = [Math.max(this.range[0], -pause), Math.min(endOf(track), secondsAt(track, track.act[1]) + pause)];
    this.setPlaying(true);
    this.seek(this.loop[0]);
  }

  private endLoop(): void {
    if (this.loop && this.playing) this.setPlaying(false);
    this.loop = null;
  }

  private setPlaying(on: boolean): void {
    if (!on) this.loop = null;
    if (on && this.seconds >= this.range[1] - 0.01) this.seek(this.range[0]);
    this.playing = on;
    this.play.textContent = on ? '❙❙' : '▶';
    this.frames = [];
    this.last = performance.now();
    if (!on) this.save();
  }

  private step(frames: number): void {
    this.setPlaying(false);
    this.seek(this.seconds + frames / this.scene.tracks[this.focus]!.rate);
  }

  private jump(way: number): void {
    const near = 0.011, list = way > 0 ? this.happenings : [...this.happenings].reverse();
    const next = list.find((h) => way * (h.seconds - this.seconds) > near);
    this.setPlaying(false);
    if (next) this.seek(next.seconds);
    this.overlay.dataset.event = next ? next.text : '';
    this.dirty = true;
  }

  private showSpeed(): void {
    this.speedButton.textContent = `${this.speed}×`;
    this.speedButton.setAttribute('aria-label', `Speed ${this.speed}×`);
  }

  private slower(): void {
    this.speed = SPEEDS[(SPEEDS.indexOf(this.speed) + 1) % SPEEDS.length]!;
    this.showSpeed();
    this.save();
  }

  // --- state in the address

  private save(): void {
    const c = this.camera;
    const hash = writeState({
      scene: this.scene.id, tracks: [...this.visible].sort((a, b) => a - b), focus: this.focus, seconds: this.seconds,
      grid: this.grid, reference: this.reference, speed: this.speed,
      camera: this.cameraMoved ? [c.yaw, c.pitch, c.distance, ...c.target] : [],
    });
    if (hash !== location.hash) history.replaceState(null, '', hash);
  }

  private restore(hash: string): void {
    const state = readState(hash);
    const scene = this.replay.scenes.findIndex((one) => one.id === state.scene || one.id.startsWith(`${state.scene}/`));
    const key = this.replay.scenes.findIndex((one) => one.tracks.some((t) => state.scene && t.row?.key.startsWith(state.scene)));
    const index = Math.max(scene, key);
    if (index >= 0 && index !== this.sceneIndex) this.open(index);
    if (key >= 0 && scene < 0) {
      this.focus = this.scene.tracks.findIndex((track) => track.row?.key.startsWith(state.scene!));
      this.choose('engines');
    }
    const count = this.scene.tracks.length;
    if (state.focus !== undefined && state.focus < count && state.focus >= 0) this.focus = Math.floor(state.focus);
    if (state.tracks) this.visible = new Set(state.tracks.filter((i) => Number.isInteger(i) && i >= 0 && i < count));
    this.grid = state.grid ?? this.grid;
    this.reference = state.reference ?? this.reference;
    if (state.speed) this.speed = state.speed;
    this.showSpeed();
    if (state.camera) {
      const [yaw, pitch, distance, x, y, z] = state.camera as [number, number, number, number, number, number];
      Object.assign(this.camera, {yaw, pitch, distance, target: [x, y, z]});
      this.cameraMoved = true;
    }
    if (state.seconds !== undefined) this.seek(state.seconds);
    this.refresh();
  }

  // --- keys and pointers

  private key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || this.keys.open) return;
    if (target instanceof HTMLInputElement && target.type === 'search') return;
    const typing = target instanceof HTMLInputElement && target.type === 'range';
    const pressed = target instanceof HTMLButtonElement || (target instanceof HTMLInputElement && target.type === 'checkbox') || target.tagName === 'SUMMARY';
    const act: Record<string, () => void> = {
      ' ': () => this.setPlaying(!this.playing),
      ArrowLeft: () => this.step(event.shiftKey ? -25 : -1),
      ArrowRight: () => this.step(event.shiftKey ? 25 : 1),
      ArrowUp: () => this.setFocus(this.focus - 1),
      ArrowDown: () => this.setFocus(this.focus + 1),
      PageUp: () => this.open(this.sceneIndex - 1),
      PageDown: () => this.open(this.sceneIndex + 1),
      Home: () => this.seek(this.range[0]),
      End: () => this.seek(this.range[1]),
      '[': () => this.jump(-1),
      ']': () => this.jump(1),
      s: () => this.slower(),
      g: () => this.toggle('grid'),
      r: () => this.toggle('reference'),
      h: () => this.toggle('hold'),
      n: () => this.toggleNull(),
      '?': () => this.keys.showModal(),
      '1': () => this.preset(0),
      '2': () => this.preset(1),
      '3': () => this.preset(2),
      '4': () => this.preset(3),
    };
    const found = act[event.key] ?? act[event.key.toLowerCase()];
    if (!found || (pressed && event.key === ' ') || (typing && event.key.startsWith('Page'))) return;
    event.preventDefault();
    if (event.key !== ' ') this.endLoop();
    found();
  }

  private moved(): void {
    this.cameraMoved = true;
    this.dirty = true;
  }

  private frameCamera(): void {
    this.camera.frame(...pairOf(this.scene.tracks[this.focus]!));
    this.cameraMoved = false;
  }

  private preset(i: number): void {
    const [a, b] = pairOf(this.scene.tracks[this.focus]!), line = Math.atan2(b[1] - a[1], b[0] - a[0]);
    this.frameCamera();
    const c = this.camera;
    if (i === 0) Object.assign(c, {yaw: line - Math.PI / 2, pitch: 0.12});
    if (i === 1) Object.assign(c, {yaw: line + Math.PI - 0.35, pitch: 0.35, distance: 2.6, target: [...a.slice(0, 2), 1.0]});
    if (i === 2) Object.assign(c, {yaw: line + 0.15, pitch: 0.25, distance: 2.2, target: [...a.slice(0, 2), 0.95]});
    if (i === 3) Object.assign(c, {yaw: line - Math.PI / 2, pitch: 1.5, distance: 4});
    this.cameraMoved = i !== 0;
    this.save();
    this.dirty = true;
  }

  // --- the picture

  private tick(now: number): void {
    if (this.playing) {
      const passed = Math.min(0.2, (now - this.last) / 1000);
      this.last = now;
      this.seek(this.seconds + passed * this.speed);
      if (this.loop && this.seconds >= this.loop[1]) this.seek(this.loop[0]);
      else if (this.seconds >= this.range[1]) this.setPlaying(false);
      this.pace(now);
    }
    if (this.dirty) {
      this.dirty = this.sharp = false;
      this.movedAt = now;
      this.draw();
    } else if (!this.sharp && !this.playing && now - this.movedAt > 180) {
      this.sharp = true;
      this.draw();
    }
    if (this.app.dataset.ready === undefined) this.app.dataset.ready = (performance.now() - begun).toFixed(0);
    requestAnimationFrame((next) => this.tick(next));
  }

  // Fewer pixels where the pictures come slowly.
  private pace(now: number): void {
    this.frames.push(now);
    if (this.frames.length < 31) return;
    const each = (now - this.frames[0]!) / 30;
    this.app.dataset.fps = (1000 / each).toFixed(1);
    if (each > 34 && this.scale > 0.4) this.scale *= 0.82;
    this.frames = [];
  }

  private draw(): void {
    const labels: [number, number, string, string][] = [];
    for (const i of this.visible) this.actors[i]!.update(this.seconds, rgb(this.colours[i]!), this.hold);
    if (this.renderer) {
      const pixels = (window.devicePixelRatio || 1) * (this.sharp ? 1 : this.scale);
      const width = Math.max(1, Math.round(this.canvas.clientWidth * pixels)), height = Math.max(1, Math.round(this.canvas.clientHeight * pixels));
      if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
      this.renderer.begin();
      if (this.grid) this.drawGrid(width, height, labels);
      else this.drawGhosts(width, height, labels);
      this.app.dataset.capsules = String(this.renderer.drawn);
    }
    this.overlay.replaceChildren(...labels.map(([x, y, text, kind]) => {
      const label = el('span', {class: kind}, text);
      label.style.left = `${100 * x}%`;
      label.style.top = `${100 * y}%`;
      return label;
    }));
  }

  private drawGhosts(width: number, height: number, labels: [number, number, string, string][]): void {
    const view = this.camera.view(width / height), focus = this.actors[this.focus]!;
    const layers = focus.layers(false, this.reference, true);
    for (const i of this.visible) if (i !== this.focus) layers.push(...this.actors[i]!.layers(true, false, false));
    this.renderer!.draw(0, 0, width, height, view, this.camera.target, layers, themeOf(this.app));
    this.label(focus, view, 0, 0, 1, 1, labels);
  }

  private drawGrid(width: number, height: number, labels: [number, number, string, string][]): void {
    const shown = [...this.visible].sort((a, b) => a - b), columns = Math.ceil(Math.sqrt(shown.length * Math.max(1, width / height / 1.2)));
    const across = Math.min(columns, shown.length), down = Math.ceil(shown.length / across), theme = themeOf(this.app);
    const w = Math.floor(width / across), h = Math.floor(height / down);
    for (const [k, i] of shown.entries()) {
      const actor = this.actors[i]!, column = k % across, row = Math.floor(k / across), view = this.camera.view(w / h);
      this.renderer!.draw(column * w, height - (row + 1) * h, w, h, view, this.camera.target,
                          actor.layers(false, this.reference, true), theme);
      const word = wordOf(actor.track);
      labels.push([column / across, row / down, actor.track.row ? `${actor.track.name}: ${word}` : actor.track.name, `cell ${word}`]);
      this.label(actor, view, column / across, row / down, 1 / across, 1 / down, labels);
    }
  }

  private label(actor: Actor, view: View, x: number, y: number, w: number, h: number, to: [number, number, string, string][]): void {
    for (const one of actor.labels) {
      const at = project(view, one.at);
      if (at && at[0] > 0 && at[0] < 1 && at[1] > 0 && at[1] < 1) to.push([x + w * at[0], y + h * at[1], one.text, 'force']);
    }
    if (this.overlay.dataset.event) to.push([x + 0.5 * w, y + 0.96 * h, this.overlay.dataset.event, 'event']);
  }
}

async function start(): Promise<void> {
  const app = document.getElementById('app')!, data = document.getElementById('duet-replay');
  try {
    const replay = await readReplay(data?.textContent ?? '');
    data?.remove();
    (document.getElementById('all-episodes') as HTMLDetailsElement | null)?.removeAttribute('open');
    new Page(replay, app);
  } catch (error) {
    app.append(el('p', {class: 'nogl', role: 'alert'}, `Nothing can be shown: ${error instanceof Error ? error.message : String(error)}. The table below stays.`));
    app.dataset.ready = 'failed';
    throw error;
  }
}

void start();
