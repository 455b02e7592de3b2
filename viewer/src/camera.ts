// An orbit around a point, z up.
import {Vec3} from './kinematics';

export interface View {
  matrix: Float32Array; // projection times view, column-major
  eye: Vec3;
}

export class Camera {
  target: Vec3 = [0, 0, 0.8];
  yaw = 0; // of the eye, seen from the target [rad]
  pitch = 0.22;
  distance = 3.6;

  get eye(): Vec3 {
    const c = Math.cos(this.pitch) * this.distance;
    return [
      this.target[0] + c * Math.cos(this.yaw),
      this.target[1] + c * Math.sin(this.yaw),
      this.target[2] + Math.sin(this.pitch) * this.distance,
    ];
  }

  turn(dx: number, dy: number): void {
    this.yaw -= dx;
    this.pitch = Math.min(1.55, Math.max(-0.15, this.pitch + dy));
  }

  // In parts of the picture's height.
  shift(dx: number, dy: number): void {
    const s = this.distance * 0.8;
    this.target[0] += s * dx * Math.sin(this.yaw);
    this.target[1] -= s * dx * Math.cos(this.yaw);
    this.target[2] = Math.min(2.5, Math.max(0, this.target[2] + s * dy));
  }

  zoom(factor: number): void {
    this.distance = Math.min(14, Math.max(0.5, this.distance * factor));
  }

  // The side view of a pair: the robot at `a`, its partner at `b`.
  frame(a: Vec3, b: Vec3): void {
    const line = Math.atan2(b[1] - a[1], b[0] - a[0]), gap = Math.hypot(b[0] - a[0], b[1] - a[1]);
    this.target = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, 0.82];
    this.yaw = line - Math.PI / 2 + 0.35;
    this.pitch = 0.2;
    this.distance = Math.max(2.3, 1.5 + 1.0 * gap);
  }

  view(aspect: number): View {
    const eye = this.eye, t = this.target;
    const f = unit([t[0] - eye[0], t[1] - eye[1], t[2] - eye[2]]);
    const s: Vec3 = unit([f[1], -f[0], 0]);
    const u: Vec3 = [s[1] * f[2] - s[2] * f[1], s[2] * f[0] - s[0] * f[2], s[0] * f[1] - s[1] * f[0]];
    const dot = (a: Vec3) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    // A narrow picture needs a wider angle to show the two people.
    const y = 1 / Math.tan(aspect < 1 ? 0.42 / Math.max(aspect, 0.55) : 0.42), near = 0.05, far = 60;
    const x = y / aspect, a = (far + near) / (near - far), b = (2 * far * near) / (near - far);
    const rows = [
      [x * s[0], x * s[1], x * s[2], x * dot(s)],
      [y * u[0], y * u[1], y * u[2], y * dot(u)],
      [-a * f[0], -a * f[1], -a * f[2], -a * dot(f) + b],
      [f[0], f[1], f[2], dot(f)],
    ];
    const matrix = new Float32Array(16);
    for (let r = 0; r < 4; ++r) for (let c = 0; c < 4; ++c) matrix[4 * c + r] = rows[r]![c]!;
    return {matrix, eye};
  }
}

// Lets pointers on the canvas turn (drag), shift (right button, or with Shift) and zoom (wheel, two fingers) the camera.
export function steer(camera: Camera, canvas: HTMLCanvasElement, moved: () => void, released: () => void = () => {}): void {
  const down = new Map<number, PointerEvent>();
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('pointerdown', (event) => {
    down.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', (event) => {
    const before = down.get(event.pointerId);
    if (!before) return;
    const height = canvas.clientHeight, dx = (event.clientX - before.clientX) / height, dy = (event.clientY - before.clientY) / height;
    if (down.size > 1) {
      const other = [...down.values()].find((one) => one.pointerId !== event.pointerId)!;
      const apart = (one: PointerEvent) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      camera.zoom(apart(before) / Math.max(apart(event), 1));
    } else if (before.button === 2 || event.shiftKey) camera.shift(-dx, dy);
    else camera.turn(4 * dx, 3 * dy);
    down.set(event.pointerId, Object.assign(event, {}));
    moved();
  });
  for (const name of ['pointerup', 'pointercancel'] as const)
    canvas.addEventListener(name, (event) => { down.delete(event.pointerId); released(); });
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(event.deltaY * 0.001));
    moved();
  }, {passive: false});
}

// In parts of the picture, (0, 0) at its top left; null behind the eye.
export function project(view: View, p: ArrayLike<number>): [number, number] | null {
  const m = view.matrix, x = p[0]!, y = p[1]!, z = p[2]!;
  const w = m[3]! * x + m[7]! * y + m[11]! * z + m[15]!;
  if (w < 0.05) return null;
  return [
    0.5 + (0.5 * (m[0]! * x + m[4]! * y + m[8]! * z + m[12]!)) / w,
    0.5 - (0.5 * (m[1]! * x + m[5]! * y + m[9]! * z + m[13]!)) / w,
  ];
}

function unit(v: Vec3): Vec3 {
  const n = Math.hypot(...v) || 1;
  return [v[0] / n, v[1] / n, v[2] / n];
}
