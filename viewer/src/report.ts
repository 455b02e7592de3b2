// The page of a report: its tables stand in it already (report/page/html_report.h). This makes them sortable and searchable,
// marks cells, and draws plots, axes and bars from the data of the page, schema `duet.report/1`.
import './report.css';
import {el, svg} from './dom';
import {Plot, drawn} from './plot';

interface Figure { // as `duet report -f json` writes it
  engine: string;
  controller: string;
  policy: string;
  arm: string;
  perturbation: string;
  task: string;
  name: string;
  n?: number;
  k?: number;
  value: number | null;
  low?: number;
  high?: number;
}

interface Analysis {
  level: number;
  figures: Figure[];
}

interface Report {
  schema: string;
  plots: Plot[];
  tasks: {name: string; title: string}[];
  board?: Analysis;
  leaderboard?: Analysis;
  metrics?: Record<string, {title: string; unit: string; direction: string}>;
  replays?: Record<string, string>; // page of an episode by its key
}

type Wanted = Record<string, string>; // column of the episodes -> its value

const SCHEMA = 'duet.report/1';
const PHYSICS = (engine: string) => engine !== 'playback';

function percent(fraction: number): string { return (100 * fraction).toFixed(1); }
// The first number of a cell: its order, and what is drawn of it.
function numberOf(cell: Element): number { return parseFloat(cell.textContent!.replace(/^[<+]/, '')); }
function headsOf(table: HTMLTableElement): string[] { return Array.from(table.tHead!.rows[0]!.cells, (cell) => cell.textContent!); }
function rowsOf(table: HTMLTableElement): HTMLTableRowElement[] { return Array.from(table.tBodies[0]!.rows); }
function tableOf(section: string): HTMLTableElement | null { return document.querySelector(`#${section} table`); }
// An arm: what rows of a table and figures have in common.
function armOf(figure: Figure): string { return JSON.stringify([figure.arm, figure.controller, figure.policy, figure.perturbation]); }

function sortBy(table: HTMLTableElement, head: HTMLElement, column: number): void {
  const down = head.getAttribute('aria-sort') !== 'descending', body = table.tBodies[0]!;
  for (const other of table.tHead!.rows[0]!.cells) other.removeAttribute('aria-sort');
  head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
  const cells = rowsOf(table).map((row) => row.cells[column]!);
  const numeric = cells.every((cell) => cell.textContent === '-' || !isNaN(numberOf(cell)));
  const order = (a: HTMLElement, b: HTMLElement) => {
    if (!numeric) return a.textContent!.localeCompare(b.textContent!);
    const [x, y] = [a, b].map((cell) => cell.textContent === '-' ? -Infinity : numberOf(cell));
    return x! < y! ? -1 : x! > y! ? 1 : 0;
  };
  cells.sort((a, b) => down ? order(b, a) : order(a, b));
  body.append(...cells.map((cell) => cell.parentNode!));
}

function makeSortable(table: HTMLTableElement): void {
  Array.from(table.tHead!.rows[0]!.cells).forEach((head, column) => {
    const button = el('button', {type: 'button'}, head.textContent);
    button.addEventListener('click', () => sortBy(table, head, column));
    head.replaceChildren(button);
  });
}

// On a narrow screen the last label of a row stands alone, with the others below it (report.css).
function markContext(table: HTMLTableElement): void {
  const labels = table.tBodies[0]!.rows[0]?.querySelectorAll('th').length ?? 0;
  if (labels < 2 || table.classList.contains('ranked')) return;
  for (const row of [...table.tHead!.rows, ...rowsOf(table)]) {
    const context = Array.from(row.cells).slice(0, labels - 1);
    for (const cell of context) cell.classList.add('context');
    if (row.parentNode !== table.tHead) row.cells[labels - 1]!.dataset.where = context.map((cell) => cell.textContent).join(', ');
  }
}

// Metrics by their titles, with unit and the way that is better.
function nameMetrics(table: HTMLTableElement, metrics: NonNullable<Report['metrics']>): void {
  if (headsOf(table)[0] !== 'Metric') return;
  for (const row of rowsOf(table)) {
    const cell = row.cells[0]!, name = cell.textContent!, metric = metrics[name];
    if (!metric) continue;
    const unit = ['', '1'].includes(metric.unit) ? '' : ` [${metric.unit}]`;
    const arrow = {lower: ' ↓', higher: ' ↑'}[metric.direction] ?? '';
    cell.replaceChildren(el('span', {title: name}, metric.title || name),
                         el('span', {class: 'unit', title: arrow && `${metric.direction} is better`}, unit + arrow));
  }
}

// Success and the null arm's by arm, engine and task.
class Rates {
  private readonly found = new Map<string, Figure>();
  readonly level: number;

  constructor(private readonly leaderboard: Analysis) {
    this.level = leaderboard.level;
    for (const figure of leaderboard.figures) this.found.set(this.key(armOf(figure), figure.engine, figure.task, figure.name), figure);
  }

  private key(...parts: string[]): string { return parts.join('\n'); }

  success(arm: string, engine: string, task: string): Figure | undefined { return this.found.get(this.key(arm, engine, task, 'success')); }

  nullRate(arm: string, engine: string, task: string): number | null {
    return this.found.get(this.key(arm, engine, task, 'null_success'))?.value ?? null;
  }

  enginesOf(arm: string): string[] {
    const engines = new Set(this.leaderboard.figures.filter((figure) => armOf(figure) === arm).map((figure) => figure.engine));
    const physics = [...engines].filter(PHYSICS);
    return (physics.length > 0 ? physics : [...engines]).sort();
  }

  // Mean over the engines that ran the task.
  mean(arm: string, task: string): number | null {
    const rates = this.enginesOf(arm).flatMap((engine) => this.success(arm, engine, task)?.value ?? []);
    return rates.length === 0 ? null : rates.reduce((a, b) => a + b, 0) / rates.length;
  }

  // One figure for each row of the table of all engines and tasks, in its order (report/ranking/leaderboard_rows.h).
  rows(): Figure[] {
    const rank = (figure: Figure) => figure.arm === 'main' ? 0 : figure.arm === 'null' ? 2 : 1;
    const place = (f: Figure) => [f.engine, f.controller, f.perturbation, rank(f), f.policy, f.arm];
    const rows = this.leaderboard.figures.filter((figure) => figure.name === 'success' && figure.task === 'all');
    const order = (a: (string | number)[], b: (string | number)[]) => {
      const i = a.findIndex((part, at) => part !== b[at]);
      return i < 0 ? 0 : a[i]! < b[i]! ? -1 : 1;
    };
    return rows.sort((a, b) => order(place(a), place(b)));
  }
}

function tip(rate: Figure | undefined): string {
  return rate && rate.value !== null ? `${percent(rate.value)} [${percent(rate.low ?? NaN)}, ${percent(rate.high ?? NaN)}] %, ${rate.k} of ${rate.n}` : '';
}

const AXIS_WIDTH = 300, AXIS_INSET = 8, LANE = 7; // [px]

// A lane for each engine, so that dots at one place are told apart; the mean through them on the shade of its interval.
function axisOf(mean: Figure, nullRate: number, dots: {engine: string; rate: number; colour: number; tip: string}[]): SVGElement {
  const height = LANE * Math.max(dots.length, 2) + 8, x = (rate: number) => (AXIS_INSET + rate * (AXIS_WIDTH - 2 * AXIS_INSET)).toFixed(1);
  const upright = (cls: string, rate: number, ...children: Node[]) =>
    svg('line', {class: cls, x1: x(rate), x2: x(rate), y1: 0, y2: height}, ...children);
  const low = mean.low ?? mean.value!, high = mean.high ?? mean.value!;
  return svg('svg', {class: 'axis', viewBox: `0 0 ${AXIS_WIDTH} ${height}`, width: AXIS_WIDTH, height, role: 'img',
                     'aria-label': `mean ${tip(mean) || percent(mean.value!)}, engine by engine`},
             ...[0, 0.25, 0.5, 0.75, 1].map((rate) => upright('g', rate)),
             svg('rect', {class: 'b', x: x(low), y: 0, width: Math.max(1, Number(x(high)) - Number(x(low))), height}), upright('m', mean.value!),
             ...(isNaN(nullRate) ? [] : [upright('null', nullRate, svg('title', {}, `null arm ${percent(nullRate)} %`))]),
             ...dots.map((dot, i) => svg('circle', {class: `e${dot.colour % 8 + 1}`, cx: x(dot.rate), cy: 7 + LANE * i, r: 3.4},
                                         svg('title', {}, `${dot.engine} ${dot.tip || percent(dot.rate)}`))));
}

function axisLegend(engines: string[], level: number): HTMLElement {
  const key = (width: number, ...marks: SVGElement[]) => svg('svg', {width, height: 12, 'aria-hidden': 'true'}, ...marks);
  return el('p', {class: 'legend'},
            ...engines.map((engine, i) => el('span', {}, key(10, svg('circle', {class: `e${i % 8 + 1}`, cx: 5, cy: 6, r: 4})), engine)),
            el('span', {}, key(22, svg('rect', {class: 'b', width: 22, height: 12}), svg('line', {class: 'm', x1: 11, x2: 11, y1: 0, y2: 12})),
               `mean over engines with its ${+(100 * level).toFixed(1)} % interval`),
            el('span', {}, key(8, svg('line', {class: 'null', x1: 4, x2: 4, y1: 0, y2: 12})), 'the null arm'));
}

// The policy as the list of episodes calls it.
function wantedOf(arm: Figure, task = ''): Wanted {
  const policy = arm.arm === 'main' ? arm.policy : arm.arm === 'null' ? 'null arm' : `${arm.policy} (${arm.arm})`;
  return {Controller: arm.controller, Policy: policy, Perturbation: arm.perturbation, Task: task};
}

type Link = (text: string, wanted: Wanted) => HTMLElement;

// Axes in the ranked board, engine by engine, and below it what each arm reaches in each task.
function drawBoard(table: HTMLTableElement, report: Report, rates: Rates, link: Link): void {
  table.classList.add('ranked');
  const heads = headsOf(table), column = (title: string) => heads.indexOf(title);
  const [success, none, each] = ['Success [%]', 'Null', 'By engine'].map(column) as [number, number, number];
  const ratesIn = (row: HTMLTableRowElement) =>
    Array.from(row.cells[each]!.textContent!.matchAll(/(\S+) ([\d.]+)(?:,|$)/g), (found) => ({engine: found[1]!, rate: Number(found[2]) / 100}));
  const engines = [...new Set(rowsOf(table).flatMap((row) => ratesIn(row).map((rate) => rate.engine)))].sort();
  const arms = report.board!.figures.filter((figure) => figure.name === 'mean_success'), map: HTMLTableRowElement[] = [];
  rowsOf(table).forEach((row, i) => {
    const arm = arms[i];
    row.classList.toggle('control', row.cells[0]!.textContent === '-');
    if (!arm || arm.value === null || Number(percent(arm.value)) !== numberOf(row.cells[success]!)) return;
    const dots = ratesIn(row).map((dot) => ({...dot, colour: engines.indexOf(dot.engine), tip: tip(rates.success(armOf(arm), dot.engine, 'all'))}));
    const cell = row.cells[each]!, text = el('span', {class: 'ci'}, cell.textContent);
    cell.replaceChildren(axisOf(arm, numberOf(row.cells[none]!) / 100, dots), text, link(`${arm.n} × ${dots.length} episodes`, wantedOf(arm)));
    map.push(mapRow(row, arm, report, rates, link));
  });
  table.parentElement!.after(axisLegend(engines, report.board!.level));
  if (map.length > 0 && report.tasks.length > 1) table.closest('details')!.append(...taskMap(map, tasksOf(report)));
}

function tasksOf(report: Report): Report['tasks'] { return report.tasks.filter((task) => task.name !== 'all'); }

function mapRow(row: HTMLTableRowElement, arm: Figure, report: Report, rates: Rates, link: Link): HTMLTableRowElement {
  const cells = tasksOf(report).map((task) => {
    const rate = rates.mean(armOf(arm), task.name);
    return rate === null ? el('td', {class: 'zero'}, '-') : el('td', {class: `h${Math.floor(rate * 9.999)}`}, link(percent(rate), wantedOf(arm, task.name)));
  });
  const head = el('th', {scope: 'row'}, row.cells[2]!.textContent, ' ', el('span', {class: 'unit'}, arm.controller));
  return el('tr', {class: row.className}, head, ...cells);
}

function taskMap(rows: HTMLTableRowElement[], tasks: Report['tasks']): HTMLElement[] {
  const heads = [el('th', {scope: 'col', class: 'l'}, 'Policy, controller'), ...tasks.map((task) => el('th', {scope: 'col'}, task.title))];
  const table = el('table', {class: 'map'}, el('caption', {}, 'Success in %, mean over engines; a number leads to its episodes'),
                   el('thead', {}, el('tr', {}, ...heads)), el('tbody', {}, ...rows));
  return [el('h3', {id: 'tasks'}, 'Tasks'), el('div', {class: 'scroll', tabindex: '0', role: 'region', 'aria-label': 'Success by task'}, table)];
}

// The interval as a bar on [0, 1], the rate as a dot, the null arm as a tick.
function barOf(rate: Figure, nullRate: number | null, width: number): SVGElement {
  const x = (fraction: number) => (5 + fraction * (width - 10)).toFixed(1);
  const line = (cls: string, from: number, to: number, y1: number, y2: number) => svg('line', {class: cls, x1: x(from), x2: x(to), y1, y2});
  return svg('svg', {class: 'bar', width, height: 16, 'aria-hidden': 'true'}, line('track', 0, 1, 8, 8),
             line('range', rate.low ?? rate.value!, rate.high ?? rate.value!, 8, 8), ...(nullRate === null ? [] : [line('null', nullRate, nullRate, 1, 15)]),
             svg('circle', {class: 'dot', cx: x(rate.value!), cy: 8, r: 4}));
}

// Bars in the table of every engine and task.
function drawBars(table: HTMLTableElement, report: Report, rates: Rates): void {
  const titles = new Map(report.tasks.map((task) => [task.title, task.name]));
  const tasks = headsOf(table).map((head) => titles.get(head.replace(/ \(\d+\)$/, '')));
  const arms = rates.rows();
  rowsOf(table).forEach((row, i) => {
    const arm = arms[i];
    if (!arm) return;
    row.classList.toggle('control', arm.arm !== 'main');
    tasks.forEach((task, column) => {
      const cell = row.cells[column]!, rate = task && rates.success(armOf(arm), arm.engine, task);
      if (!rate || rate.value === null || Number(percent(rate.value)) !== numberOf(cell)) return;
      const nullRate = rates.nullRate(armOf(arm), arm.engine, task!);
      cell.title = `${rate.k} of ${rate.n} episodes; null arm ${nullRate === null ? '-' : percent(nullRate)} %`;
      cell.append(barOf(rate, nullRate, task === 'all' ? 116 : 72));
    });
    const lift = row.cells[headsOf(table).indexOf('Lift')]?.querySelector('.ci');
    if (lift && parseFloat(lift.textContent!.slice(1)) > 0) lift.previousElementSibling!.classList.add('gain');
  });
  const interval = `${+(100 * rates.level).toFixed(1)} % interval`;
  table.parentElement!.after(
      el('p', {class: 'legend'}, `Dot and bar: success with its ${interval} on 0 to 100 %; tick: the same episodes under the null arm.`));
}

// Search and choices above the episodes. Returns what shows some of them.
function makeFinder(table: HTMLTableElement, replays: Record<string, string>): (wanted: Wanted) => void {
  const rows = rowsOf(table), heads = headsOf(table), selects = new Map<number, HTMLSelectElement>();
  const texts = rows.map((row) => Array.from(row.cells, (cell) => cell.textContent!));
  const search = el('input', {type: 'search', placeholder: 'search', 'aria-label': 'Search episodes'}), count = el('span', {role: 'status'});
  const show = () => {
    const text = search.value.toLowerCase(), chosen = [...selects].filter(([, select]) => select.value !== '');
    let fits = 0;
    rows.forEach((row, i) => {
      row.hidden = !(chosen.every(([column, select]) => texts[i]![column] === select.value) && texts[i]!.join(' ').toLowerCase().includes(text));
      fits += row.hidden ? 0 : 1;
    });
    count.textContent = `${fits} of ${rows.length}`;
  };
  heads.forEach((name, column) => {
    const values = [...new Set(texts.map((cells) => cells[column]!))].sort();
    if (name === 'Clip' || name === 'Key' || values.length < 2) return;
    const select = el('select', {'aria-label': name}, el('option', {value: ''}, `${name}: all`), ...values.map((value) => el('option', {value}, value)));
    select.addEventListener('change', show);
    selects.set(column, select);
  });
  search.addEventListener('input', show);
  table.closest('.scroll')!.before(el('div', {class: 'finder'}, search, ...selects.values(), count));
  for (const row of rows) {
    const cell = row.lastElementChild!, key = cell.textContent!;
    if (replays[key]) cell.replaceChildren(el('a', {href: `${replays[key]}#e=${key}`}, key));
  }
  show();
  return (wanted) => {
    for (const [column, select] of selects) select.value = wanted[heads[column]!] ?? '';
    search.value = '';
    show();
  };
}

// Buttons that show the clips of one task.
function makeClipFilter(tasks: Report['tasks']): void {
  const clips = Array.from(document.querySelectorAll<HTMLElement>('article.clip'));
  const shown = tasks.filter((task) => clips.some((clip) => clip.dataset.task === task.name));
  if (shown.length < 2) return;
  const buttons = [{name: '', title: 'All'}, ...shown].map((task) => {
    const button = el('button', {type: 'button', 'aria-pressed': String(task.name === '')}, task.title);
    button.addEventListener('click', () => {
      for (const other of buttons) other.setAttribute('aria-pressed', String(other === button));
      for (const clip of clips) clip.hidden = task.name !== '' && clip.dataset.task !== task.name;
    });
    return button;
  });
  clips[0]!.before(el('div', {class: 'filter', role: 'group', 'aria-label': 'Show clips of'}, ...buttons));
}

// Opens the folds around what a link leads to.
function unfold(id: string): void {
  const target = id ? document.getElementById(id) : null;
  const fold = target?.querySelector('details.fold') ?? target?.closest('details.fold');
  if (fold) (fold as HTMLDetailsElement).open = true;
}

function drawPlots(plots: Plot[]): void {
  const figures = document.querySelectorAll<HTMLElement>('figure[data-plot]');
  const draw = (figure: HTMLElement) => { if (!figure.querySelector('svg')) figure.append(drawn(plots[Number(figure.dataset.plot)]!)); };
  // A page has thousands of them, most in folds: each is drawn when it comes into sight, all before printing.
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((one) => one.isIntersecting)) {
      draw(entry.target as HTMLElement);
      seen.unobserve(entry.target);
    }
  }, {rootMargin: '400px'});
  for (const figure of figures) seen.observe(figure);
  addEventListener('beforeprint', () => {
    for (const fold of document.querySelectorAll('details')) fold.open = true;
    figures.forEach(draw);
  });
}

function main(): void {
  const report: Report = JSON.parse(document.getElementById('duet-report')!.textContent!);
  if (report.schema !== SCHEMA) throw new Error(`this page holds data of schema ${report.schema}, and its script reads ${SCHEMA}`);
  const episodes = tableOf('episodes'), board = tableOf('board'), entries = tableOf('leaderboard');
  const show = episodes ? makeFinder(episodes, report.replays ?? {}) : () => {};
  const link: Link = (text, wanted) => {
    const made = el('a', {href: '#episodes'}, text);
    made.addEventListener('click', () => show(wanted));
    return made;
  };
  if (report.leaderboard) {
    const rates = new Rates(report.leaderboard);
    if (board && report.board) drawBoard(board, report, rates, link);
    if (entries) drawBars(entries, report, rates);
  }
  for (const table of document.querySelectorAll<HTMLTableElement>('main table')) {
    nameMetrics(table, report.metrics ?? {});
    if (rowsOf(table).length > 1 && !table.classList.contains('map')) makeSortable(table);
    markContext(table);
  }
  makeClipFilter(report.tasks);
  drawPlots(report.plots);
  for (const link of document.querySelectorAll<HTMLAnchorElement>('a[href^="#"]'))
    link.addEventListener('click', () => unfold(link.getAttribute('href')!.slice(1)));
  addEventListener('hashchange', () => unfold(location.hash.slice(1)));
  unfold(location.hash.slice(1));
}

main();
