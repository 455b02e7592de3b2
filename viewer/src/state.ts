// The part of the view that a link can carry, in the address behind '#'.
export interface ViewState {
  scene: string;
  tracks: number[]; // that are shown
  focus: number;
  seconds: number; // since the act began
  grid: boolean;
  reference: boolean;
  speed: number;
  camera: number[]; // yaw, pitch, distance, x, y, z; empty: as it is framed
}

export function writeState(state: ViewState): string {
  const fields = new URLSearchParams();
  fields.set('e', state.scene);
  fields.set('v', state.tracks.join('.'));
  fields.set('f', String(state.focus));
  fields.set('t', state.seconds.toFixed(2));
  if (state.grid) fields.set('g', '1');
  if (state.reference) fields.set('r', '1');
  if (state.speed !== 1) fields.set('s', String(state.speed));
  if (state.camera.length > 0) fields.set('c', state.camera.map((x) => x.toFixed(2)).join('_'));
  return '#' + fields.toString();
}

function numbers(text: string | null, separator: string): number[] {
  if (!text) return [];
  return text.split(separator).map(Number).filter(Number.isFinite);
}

// Reads the view from an address; a value that is missing or no number is left out.
export function readState(hash: string): Partial<ViewState> {
  const fields = new URLSearchParams(hash.replace(/^#/, ''));
  const state: Partial<ViewState> = {};
  const scene = fields.get('e');
  if (scene) state.scene = scene;
  if (fields.has('v')) state.tracks = numbers(fields.get('v'), '.');
  const focus = numbers(fields.get('f'), '.')[0], seconds = numbers(fields.get('t'), '_')[0];
  if (focus !== undefined) state.focus = focus;
  if (seconds !== undefined) state.seconds = seconds;
  if (fields.has('g')) state.grid = true;
  if (fields.has('r')) state.reference = true;
  const speed = numbers(fields.get('s'), '_')[0], camera = numbers(fields.get('c'), '_');
  if (speed !== undefined && speed > 0 && speed <= 2) state.speed = speed;
  if (camera.length === 6) state.camera = camera;
  return state;
}
