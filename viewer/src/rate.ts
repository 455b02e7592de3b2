// The rating page: one episode at a time, what the robot was asked to do, and three answers. Nothing says which policy or
// engine it is or how it was judged (replay/replay_page.h).
import './rate.css';
import {Answer, Answers} from './answers';
import {Camera, steer} from './camera';
import {button, el} from './dom';
import {Replay, Scene, readReplay} from './replay';
import {Renderer, rgb, themeOf} from './renderer';
import {Actor} from './stage';
import {beginOf, endOf, pairOf} from './timeline';

const ROBOT = rgb('#0072b2');
const SPEEDS = [1, 0.5, 0.2];
const STEP = 0.02; // of the slider [s]

class Page {
  private index = -1;
  private scene!: Scene;
  private actor!: Actor;
  private seconds = 0;
  private playing = false;
  private speed = 1;
  private dirty = true;
  private last = 0;
  private readonly camera = new Camera();
  private readonly renderer: Renderer | null;
  private readonly answers: Answers;
  private readonly canvas = el('canvas', {'aria-label': 'The robot and its partner in 3-D. Drag turns, wheel zooms.', role: 'img'});
  private readonly slider = el('input', {type: 'range', class: 'slider', step: String(STEP), 'aria-label': 'Time'});
  private readonly clock = el('output', {class: 'clock'});
  private readonly play = button('▶', 'Play or pause', () => this.setPlaying(!this.playing), 'space');
  private readonly speedButton = button('1×', 'Speed 1×', () => this.slower(), 'S');
  private readonly name = el('input', {type: 'text', maxlength: '60', autocomplete: 'off'});
  private readonly place = el('p', {class: 'place'});
  private readonly progress = el('progress', {'aria-label': 'Answered'});
  private readonly question = el('h2', {tabindex: '-1', 'aria-live': 'polite'});
  private readonly buttons: Record<Answer, HTMLButtonElement> = {
    yes: button('Yes', 'Yes', () => this.answer('yes'), 'Y'),
    no: button('No', 'No', () => this.answer('no'), 'N'),
    unsure: button('Unsure', 'Unsure', () => this.answer('unsure'), 'U'),
  };
  private readonly before = button('← Before', 'Episode before', () => this.open(this.index - 1), '←');
  private readonly after = button('Next →', 'Next episode', () => this.open(this.index + 1), '→');
  private readonly exported = button('Export', 'Export the answers as CSV', () => this.save());
  private readonly word = el('p', {class: 'note', role: 'status'});

  constructor(private readonly replay: Replay, private readonly app: HTMLElement) {
    this.answers = new Answers(replay.scenes.map((scene) => scene.id));
    this.renderer = this.makeRenderer();
    const stage = el('div', {class: 'stage'}, this.renderer ? this.canvas : el('p', {class: 'nogl', role: 'alert'},
      'This browser has no WebGL2, so there is no picture in 3-D and nothing can be rated here.'));
    const bar = el('div', {class: 'bar', role: 'toolbar', 'aria-label': 'Playback'}, this.play, this.speedButton, this.clock);
    const panel = el('section', {class: 'panel rating'},
      el('label', {}, 'Your name', this.name), this.place, this.progress, this.question,
      el('div', {class: 'answers'}, ...Object.values(this.buttons)), el('div', {class: 'turns'}, this.before, this.after),
      this.exported, this.word,
      el('p', {class: 'note'}, 'Keys: Y, N, U answer and go on; ← and → turn pages; space plays; S slow motion. Judge what you see: ' +
        'did the robot do this with the person? Unsure is an answer, too.'));
    app.append(el('div', {class: 'main'}, stage, bar, el('div', {class: 'slide'}, this.slider)), el('aside', {}, panel));
    this.slider.addEventListener('input', () => { this.setPlaying(false); this.seek(Number(this.slider.value)); });
    this.name.value = this.answers.rater;
    this.name.addEventListener('input', () => { this.answers.choose(this.name.value); this.show(); });
    this.name.addEventListener('keydown', (event) => { if (event.key === 'Enter') this.question.focus(); });
    window.addEventListener('keydown', (event) => this.key(event));
    window.addEventListener('storage', () => { this.answers.gather(); this.show(); });  // the same page in another tab
    window.addEventListener('beforeunload', (event) => { if (this.answers.endangered) event.preventDefault(); });
    new ResizeObserver(() => { this.dirty = true; }).observe(stage);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { this.dirty = true; });
    steer(this.camera, this.canvas, () => { this.dirty = true; });
    const first = replay.scenes.findIndex((scene) => !this.answers.of(scene.id));
    this.open(Math.max(0, first));
    if (!this.answers.rater) this.name.focus();
    requestAnimationFrame((now) => this.tick(now));
  }

  private makeRenderer(): Renderer | null {
    try {
      return new Renderer(this.canvas);
    } catch (error) {
      console.warn(`no picture in 3-D: ${String(error)}`);
      return null;
    }
  }

  // --- episodes and answers

  private open(index: number): void {
    const scene = this.replay.scenes[index];
    if (!scene) return;
    this.index = index;
    this.scene = scene;
    const track = scene.tracks[0]!;
    this.actor = new Actor(track, this.replay.limits);
    this.frameAll();
    this.slider.min = '0';
    this.slider.max = String(endOf(track) - beginOf(track));
    this.question.textContent = scene.name;
    this.show();
    this.seek(0);
    this.setPlaying(!matchMedia('(prefers-reduced-motion: reduce)').matches);
  }

  // Both are in the picture from the first frame on.
  private frameAll(): void {
    const track = this.actor.track, camera = this.camera;
    camera.frame(...pairOf(track));
    const far = [beginOf(track), endOf(track)].flatMap((seconds) => pairOf(track, seconds))
      .map((p) => Math.hypot(p[0] - camera.target[0], p[1] - camera.target[1]));
    camera.distance = Math.max(camera.distance, 1.4 + 1.5 * Math.max(...far));
  }

  private show(): void {
    const all = this.replay.scenes.length, done = this.answers.count, given = this.answers.of(this.scene.id);
    this.place.textContent = `Episode ${this.index + 1} of ${all}, ${done} answered`;
    this.progress.max = all;
    this.progress.value = done;
    for (const [name, one] of Object.entries(this.buttons)) {
      one.disabled = !this.answers.rater || !this.renderer;
      one.setAttribute('aria-pressed', String(name === given));
    }
    this.before.disabled = this.index === 0;
    this.after.disabled = this.index === all - 1;
    this.exported.disabled = !this.answers.rater || done === 0;
    this.exported.textContent = `Export ${done} of ${all} answers`;
    this.word.textContent = !this.answers.rater ? 'Give your name first.' :
      !this.answers.stored ? 'This browser keeps no answers: export before you close the page.' :
      done === all ? 'All episodes are answered: export the file and send it back.' : '';
    this.app.dataset.episode = this.scene.id;
  }

  private answer(answer: Answer): void {
    if (this.buttons[answer].disabled) return;
    this.answers.give(this.scene.id, answer);
    this.question.focus();  // a button that keeps it would take the next space
    if (this.index + 1 < this.replay.scenes.length) this.open(this.index + 1);
    else this.show();
  }

  private save(): void {
    const link = el('a', {download: `ratings-${this.answers.rater.replace(/[^\p{L}\p{N}_-]+/gu, '-')}.csv`});
    link.href = URL.createObjectURL(new Blob([this.answers.csv()], {type: 'text/csv'}));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);  // some browsers fetch it after the click
    this.show();
  }

  private key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || target === this.name) return;
    const act: Record<string, () => void> = {
      y: () => this.answer('yes'),
      n: () => this.answer('no'),
      u: () => this.answer('unsure'),
      s: () => this.slower(),
      ' ': () => this.setPlaying(!this.playing),
      arrowleft: () => this.open(this.index - 1),
      arrowright: () => this.open(this.index + 1),
    };
    const found = act[event.key.toLowerCase()];
    const own = (target instanceof HTMLButtonElement && event.key === ' ') || (target === this.slider && event.key.startsWith('Arrow'));
    if (!found || own) return;
    event.preventDefault();
    found();
  }

  // --- time and picture

  private seek(seconds: number): void {
    const end = Number(this.slider.max);
    this.seconds = Math.min(end, Math.max(0, seconds));
    this.slider.value = String(this.seconds);
    this.clock.textContent = `${this.seconds.toFixed(1)} of ${end.toFixed(1)} s`;
    this.dirty = true;
  }

  private setPlaying(on: boolean): void {
    if (on && this.seconds >= Number(this.slider.max) - STEP) this.seek(0);
    this.playing = on;
    this.play.textContent = on ? '❙❙' : '▶';
    this.last = performance.now();
  }

  private slower(): void {
    this.speed = SPEEDS[(SPEEDS.indexOf(this.speed) + 1) % SPEEDS.length]!;
    this.speedButton.textContent = `${this.speed}×`;
    this.speedButton.setAttribute('aria-label', `Speed ${this.speed}×`);
  }

  private tick(now: number): void {
    if (this.playing) {
      this.seek(this.seconds + Math.min(0.2, Math.max(0, now - this.last) / 1000) * this.speed);
      this.last = now;
      if (this.seconds >= Number(this.slider.max)) this.setPlaying(false);
    }
    if (this.dirty) this.draw();
    this.dirty = false;
    this.app.dataset.ready = '1';
    requestAnimationFrame((next) => this.tick(next));
  }

  private draw(): void {
    this.actor.update(this.seconds + beginOf(this.actor.track), ROBOT, false);
    if (!this.renderer) return;
    const pixels = (window.devicePixelRatio || 1) * (this.renderer.software ? 0.75 : 1);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * pixels)), height = Math.max(1, Math.round(this.canvas.clientHeight * pixels));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
    this.renderer.begin();
    this.renderer.draw(0, 0, width, height, this.camera.view(width / height), this.camera.target,
                       this.actor.layers(false, false, true), themeOf(this.app));
  }
}

async function start(): Promise<void> {
  const app = document.getElementById('app')!, data = document.getElementById('duet-replay');
  try {
    const replay = await readReplay(data?.textContent ?? '');
    data?.remove();
    new Page(replay, app);
  } catch (error) {
    app.append(el('p', {class: 'nogl', role: 'alert'}, `Nothing can be rated: ${error instanceof Error ? error.message : String(error)}.`));
    app.dataset.ready = 'failed';
    throw error;
  }
}

void start();
