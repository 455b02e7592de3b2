// Beside the picture: the verdict on one track with the command that repeats it, which tracks are shown, all episodes.
import {el, button} from './dom';
import {Replay, Row, Scene, Track, Verdict} from './replay';
import {holds} from './timeline';

export function wordOf(track: Track): string {
  if (!track.row || track.row.success === null) return 'not judged';
  return track.row.success ? 'success' : 'failure';
}

function facts(pairs: [string, string][]): HTMLElement {
  return el('dl', {}, ...pairs.flatMap(([name, value]) => [el('dt', {}, name), el('dd', {}, value)]));
}

// "body short by 0.091 m (limit 0.45 m), ..." of the margins that decided against.
function why(verdict: Verdict, track: Track): string {
  const trace = track.detectors.find((one) => one.version === verdict.version && one.set === verdict.thresholds);
  const short = (name: string, margin: number) => {
    const k = trace?.names.indexOf(name) ?? -1, unit = k >= 0 ? trace!.units[k]! : '';
    const limit = unit ? ` ${unit} (limit ${Number(Math.abs(trace!.thresholds[k]!).toPrecision(3))} ${unit})` : '';
    return `${name.replaceAll('_', ' ')} short by ${Number(Math.abs(margin).toPrecision(3))}${limit}`;
  };
  const parts = Object.entries(verdict.parts).filter(([, ok]) => !ok).map(([name]) => name.replaceAll('_', ' '));
  const margins = Object.entries(verdict.margins)
                      .filter(([, margin]) => margin !== null && margin < 0)
                      .map(([name, margin]) => short(name, margin!));
  const text = [parts.length > 0 ? `not met: ${parts.join(', ')}` : '', margins.join(', ')];
  return text.filter((part) => part).join('; ');
}

function verdictTable(row: Row, track: Track): HTMLElement {
  return el('table', {class: 'verdicts'}, el('caption', {}, 'Every detector'), el('tbody', {}, ...row.verdicts.map((verdict) =>
    el('tr', {}, el('th', {scope: 'row'}, `${verdict.version} / ${verdict.thresholds}`),
       el('td', {}, el('span', {class: verdict.success ? 'good' : 'bad'}, verdict.success ? '✓ success' : '✗ failure'),
          verdict.success ? null : el('span', {class: 'why'}, why(verdict, track)))))));
}

// The headline detector's verdict at the end of a motion that no run judged.
function seenIn(track: Track, task: string): string {
  const detector = track.detectors[0];
  if (!track.robot) return 'People, no robot';
  if (!detector) return 'Not judged';
  const sees = holds(detector.success, detector.frames.length - 1);
  return `The detector sees ${sees ? 'a' : 'no'} ${task.replaceAll('_', ' ')}`;
}

export function verdictPanel(track: Track, task: string): HTMLElement {
  const word = wordOf(track), row = track.row;
  const text = row ? `${word[0]!.toUpperCase()}${word.slice(1)}` : seenIn(track, task);
  const panel = el('section', {class: 'panel verdict', 'aria-label': 'Verdict'},
                   el('h2', {class: word}, el('span', {class: 'mark', 'aria-hidden': 'true'}, word === 'success' ? '✓' : word === 'failure' ? '✗' : '–'),
                      ` ${text}`), el('p', {class: 'who'}, track.name));
  if (track.outcome !== 'ok') panel.append(el('p', {class: 'bad'}, `${track.outcome}${track.message ? `: ${track.message}` : ''}`));
  if (!row) {
    panel.append(el('p', {}, track.origin));
    return panel;
  }
  if (row.verdicts.length > 0) panel.append(verdictTable(row, track));
  const late = row.late_plans + (row.policy_faults?.late ?? 0);
  if (late > 0) panel.append(el('p', {class: 'bad'}, `${late} plans came late (the recording does not say when)`));
  if (track.repeat) {
    const command = el('code', {}, track.repeat);
    const copy = button('Copy', 'Copy the command that runs this episode again', () => {
      void navigator.clipboard?.writeText(track.repeat).then(() => { copy.textContent = 'Copied'; });
    });
    panel.append(el('p', {class: 'command'}, command, copy));
  }
  const short = (digest: string) => digest ? digest.slice(0, 10) : 'not known';
  panel.append(el('details', {}, el('summary', {}, 'What made it'), facts([
    ['recording', track.origin], ['seed', String(row.seed)], ['engine', `${row.engine} ${row.engine_version}`],
    ['controller', `${row.controller} ${short(row.controller_digest)}`], ['policy', `${row.policy} ${short(row.policy_digest)}`],
    ['robot', `${track.robot?.name ?? 'none'} ${short(row.robot_digest)}`], ['states', short(row.state_hash)], ['episode', row.key.slice(0, 16)],
  ])));
  return panel;
}

export interface TrackChoice {
  colours: string[];
  visible: Set<number>;
  focus: number;
}

export function tracksPanel(scene: Scene, choice: TrackChoice, toggle: (index: number) => void, focus: (index: number) => void,
                            choose: (which: 'engines' | 'policies' | 'all' | 'one') => void): HTMLElement {
  const rows = scene.tracks.map((track, i) => {
    const box = el('input', {type: 'checkbox', 'aria-label': `Show ${track.name}`});
    box.checked = choice.visible.has(i);
    box.addEventListener('change', () => toggle(i));
    const swatch = el('span', {class: 'swatch', 'aria-hidden': 'true'});
    swatch.style.background = choice.visible.has(i) ? choice.colours[i]! : 'transparent';
    swatch.style.borderColor = choice.colours[i]!;
    const word = wordOf(track);
    const name = el('button', {type: 'button', class: 'name', 'aria-pressed': String(i === choice.focus)}, track.name);
    name.addEventListener('click', () => focus(i));
    return el('li', {class: i === choice.focus ? 'focus' : ''}, box, swatch, name,
              el('span', {class: `word ${word}`}, !track.row ? '' : track.outcome === 'ok' ? word : track.outcome));
  });
  const some = (text: string, label: string, which: 'engines' | 'policies' | 'all' | 'one') => button(text, label, () => choose(which));
  return el('section', {class: 'panel tracks', 'aria-label': 'Tracks'}, el('h2', {}, 'Who is shown'),
            el('p', {class: 'choices', ...(scene.tracks.some((track) => track.row) ? {} : {hidden: ''})}, some('engines', 'The same policy in every engine', 'engines'),
               some('policies', 'Every policy in the same engine', 'policies'), some('all', 'All tracks', 'all'),
               some('one', 'This track alone', 'one')),
            el('ul', {}, ...rows));
}

export function episodesPanel(replay: Replay, current: number, open: (index: number) => void): HTMLElement {
  const list = el('ul', {});
  const items = replay.scenes.map((scene, i) => {
    const dots = el('span', {class: 'dots', 'aria-hidden': 'true'}, ...scene.tracks
      .filter((track) => track.row?.arm === 'main')
      .map((track) => el('i', {class: wordOf(track)})));
    const title = scene.task ? `${scene.task.replaceAll('_', ' ')} · ${scene.name}` : scene.name;
    const more = scene.perturbation && scene.perturbation !== 'clean' ? ` · ${scene.perturbation}` : '';
    const item = el('button', {type: 'button', 'aria-current': String(i === current)}, el('span', {}, title + more), dots,
                    el('span', {class: 'count'}, scene.judged > 0 ? `${scene.successes} of ${scene.judged}` : ''));
    item.addEventListener('click', () => open(i));
    return el('li', {}, item);
  });
  list.append(...items);
  const panel = el('section', {class: 'panel episodes', 'aria-label': 'Episodes'},
                   el('h2', {}, replay.episodes_of_run > 0 ? 'Episodes, least agreement first' : 'Motions'));
  if (replay.scenes.length > 8) {
    const search = el('input', {type: 'search', placeholder: 'filter', 'aria-label': 'Filter episodes'});
    search.addEventListener('input', () => {
      for (const [i, item] of items.entries())
        item.hidden = !replay.scenes[i]!.id.toLowerCase().includes(search.value.toLowerCase());
    });
    panel.append(search);
  }
  panel.append(list);
  return panel;
}

export const KEYS: [string, string][] = [
  ['space', 'play or pause'], ['← →', 'a frame back or on, with Shift half a second'], ['[ ]', 'event before, next event'],
  ['1 2 3 4', 'camera: side, over the shoulder, partner\u2019s eyes, above'], ['S', 'slow motion: 1, 0.5, 0.2, 0.1 times'],
  ['G', 'ghosts or side by side'], ['R', 'reference'], ['N', 'null arm'], ['H', 'hold the peak of each force'],
  ['↑ ↓', 'track before, next track'], ['PgUp PgDn', 'episode before, next episode'], ['?', 'these keys'],
];

export function keysPanel(): HTMLDialogElement {
  const dialog = el('dialog', {class: 'keys', 'aria-label': 'Keys'}, el('h2', {}, 'Keys'), facts(KEYS));
  dialog.append(button('Close', 'Close', () => dialog.close()));
  return dialog;
}
