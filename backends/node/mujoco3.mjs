// Today's MuJoCo (@mujoco/mujoco) as an engine of duet: the scene as MJCF, the torque law in the armature, the skin in
// the contact's rows, as backends/mujoco has them for Debian's (its README says why).
import path from 'node:path';
import {pathToFileURL} from 'node:url';
import {layoutOf} from './layout.mjs';

const [BODY, JOINT, GEOM] = [1, 3, 5]; // mjtObj
const [GROUND, HUMAN, ROBOT] = [0, 1, 2]; // duet's ContactSide
const KINDS = {sphere: 'sphere', capsule: 'capsule'};
const CONTACTS = 64; // more than a robot touches with at once
const FAR_AWAY = 1000; // [m], where capsules wait until the partner is there
const LONGEST = 1; // [m], half length: MuJoCo's broad phase keeps the box of the capsule that it has compiled
const IMPEDANCE = '0.95 0.99 0.001'; // of the ground and of the robot itself
const LEAST_MASS = 1e-9; // [kg], of a skin without spring and damper
const FASTEST = 1e4; // [m/s], [rad/s]: beyond it a step has diverged

const text = (numbers) => numbers.join(' ');

function shapeXml(scene, shape, index) {
  return `<geom name='s${index}' type='${KINDS[shape.kind]}' size='${shape.radius} ${shape.half_length}' ` +
      `pos='${text(shape.p)}' quat='${text(shape.quat_wxyz)}' contype='0' conaffinity='1' condim='3' priority='1' ` +
      `friction='${scene.friction.robot_human} 0 0'/>`;
}

function linkXml(scene, index) {
  const {links, joints, shapes} = scene.robot, link = links[index], joint = joints[index - 1];
  const hinge = index === 0 ? '<freejoint name=\'base\'/>' :
      `<joint name='j${index - 1}' type='hinge' axis='${text(link.axis)}' limited='true' ` +
      `range='${joint.lower} ${joint.upper}' armature='${joint.armature}' solreflimit='${2 * scene.dt} 1' ` +
      'solimplimit=\'0.99 0.999 0.001\'/>';
  return `<body name='l${index}' pos='${text(link.p)}' quat='${text(link.quat_wxyz)}'>` +
      `<inertial pos='${text(link.com)}' mass='${link.mass}' fullinertia='${text(link.inertia)}'/>` + hinge +
      shapes.map((shape, i) => shape.link === index ? shapeXml(scene, shape, i) : '').join('') +
      links.map((child, i) => child.parent === index ? linkXml(scene, i) : '').join('') + '</body>';
}

function pairsXml(scene) {
  const softness = `solref='${Math.max(scene.options.ground_time_constant, 2 * scene.dt)} 1' solimp='${IMPEDANCE}'`;
  const pair = (a, b, mu) =>
    `<pair geom1='${a}' geom2='${b}' condim='3' friction='${mu} ${mu} 0 0 0' ${softness}/>`;
  const own = scene.self_collision ? scene.robot.self_collision : [];
  return '<contact>' + scene.robot.shapes.map((_, i) => pair('ground', `s${i}`, scene.friction.robot_ground)).join('') +
      own.map(([a, b]) => pair(`s${a}`, `s${b}`, scene.friction.robot_robot)).join('') + '</contact>';
}

/** The scene as MJCF. Names in it are indices: links l0, joints j0, shapes s0, capsules of the human h0. */
export function mjcf(scene) {
  const {options} = scene;
  const capsules = scene.capsules.map((capsule, i) =>
    `<body name='h${i}' mocap='true' pos='${i} 0 ${FAR_AWAY}'><geom name='h${i}' type='capsule' ` +
    `size='${capsule.radius} ${LONGEST}' contype='1' conaffinity='0' condim='3' priority='0'/></body>`);
  return '<mujoco><compiler angle=\'radian\' inertiafromgeom=\'false\' boundmass=\'0\' boundinertia=\'0\' ' +
      'balanceinertia=\'false\'/><size memory=\'8M\'/>' +
      `<option timestep='${scene.dt}' gravity='${text(scene.gravity)}' integrator='Euler' ` +
      `solver='${options.solver === 'newton' ? 'Newton' : 'CG'}' cone='${options.cone}' ` +
      `iterations='${options.iterations}' tolerance='${options.tolerance}' impratio='${options.impratio}' ` +
      'jacobian=\'dense\'><flag frictionloss=\'disable\' equality=\'disable\' spring=\'disable\' damper=\'disable\' ' +
      'sensor=\'disable\' actuation=\'disable\' autoreset=\'disable\' island=\'disable\'/></option>' +
      '<worldbody><geom name=\'ground\' type=\'plane\' size=\'0 0 1\' contype=\'0\' conaffinity=\'0\'/>' +
      linkXml(scene, 0) + capsules.join('') + '</worldbody>' + pairsXml(scene) + '</mujoco>';
}

class World {
  constructor(mujoco, scene) {
    this.mujoco = mujoco;
    this.scene = scene;
    this.model = mujoco.MjModel.from_xml_string(mjcf(scene));
    this.data = new mujoco.MjData(this.model);
    this.memory = this.model.nv; // the solver's warm start
    this.contacts = CONTACTS;
    this.layout = layoutOf(scene, this.memory);
    this.find();
    const n = this.layout.n;
    this.drive = new Float64Array(n);
    this.added = new Float64Array(n);
    this.speed = new Float64Array(n);
    this.pushed = false;
  }

  free() {
    this.data.delete();
    this.model.delete();
  }

  /** Where the robot and the human are in MuJoCo's arrays. */
  find() {
    const {scene, model, mujoco} = this, id = (type, name) => mujoco.mj_name2id(model, type, name);
    const joints = scene.robot.joints.map((_, i) => id(JOINT, `j${i}`));
    this.q = joints.map((joint) => model.jnt_qposadr[joint]);
    this.v = joints.map((joint) => model.jnt_dofadr[joint]);
    this.bodies = scene.robot.links.map((_, i) => id(BODY, `l${i}`));
    this.geoms = Array.from({length: model.ngeom}, () => ({side: GROUND, index: -1, shape: -1}));
    scene.robot.shapes.forEach((shape, i) => {
      this.geoms[id(GEOM, `s${i}`)] = {side: ROBOT, index: shape.link, shape: i};
    });
    this.capsules = scene.capsules.map((_, i) => id(GEOM, `h${i}`));
    this.capsules.forEach((geom, i) => { this.geoms[geom] = {side: HUMAN, index: i, shape: -1}; });
    this.mocap = this.capsules.map((geom) => model.body_mocapid[model.geom_bodyid[geom]]);
    this.pairs = new Set(scene.robot.self_collision.map(([a, b]) => `${a} ${b}`));
  }

  /** Views of MuJoCo's arrays: made once, and again where WebAssembly's memory has moved. */
  look() {
    if (this.view !== undefined && this.view.qpos.length > 0) return;
    const view = {};
    for (const name of ['qpos', 'qvel', 'qacc', 'qacc_warmstart', 'qfrc_applied', 'xfrc_applied', 'xpos', 'xipos',
      'xmat', 'mocap_pos', 'mocap_quat', 'M']) view[name] = this.data[name];
    for (const name of ['dof_armature', 'geom_size', 'geom_rbound', 'M_rowadr', 'M_rownnz'])
      view[name] = this.model[name];
    this.view = view;
  }

  step(request, answer) {
    const {mujoco, model, data} = this;
    this.look();
    this.place(request);
    this.beginLaw(request);
    mujoco.mj_step1(model, data);
    this.push(request);
    const contacts = this.readContacts();
    this.setSkin(contacts, request);
    this.accelerate();
    const force = data.efc_force;
    mujoco.mj_Euler(model, data);
    return this.write(contacts, force, request, answer);
  }

  place(request) {
    const {view, layout} = this, {n} = layout, at = layout.in;
    for (let i = 0; i < 7; ++i) view.qpos[i] = request[i];
    for (let i = 0; i < 6; ++i) view.qvel[i] = request[7 + i];
    for (let i = 0; i < n; ++i) {
      view.qpos[this.q[i]] = request[at.q + i];
      view.qvel[this.v[i]] = this.speed[i] = request[at.v + i];
    }
    for (let i = 0; i < this.memory; ++i) view.qacc_warmstart[i] = request[at.memory + i];
    this.data.time = 0;
    this.mocap.forEach((mocap, i) => this.placeCapsule(mocap, i, request));
  }

  placeCapsule(mocap, i, request) {
    const {view, layout} = this, from = layout.in.capsules + 14 * i, present = request[layout.in.present] !== 0;
    const away = [i, 0, FAR_AWAY, 1, 0, 0, 0, 0.1], value = (k) => present ? request[from + k] : away[k];
    for (let k = 0; k < 3; ++k) view.mocap_pos[3 * mocap + k] = value(k);
    for (let k = 0; k < 4; ++k) view.mocap_quat[4 * mocap + k] = value(3 + k);
    const geom = this.capsules[i];
    view.geom_size[3 * geom + 1] = value(7);
    view.geom_rbound[geom] = value(7) + view.geom_size[3 * geom];
  }

  /** t0 as an applied torque, dt kd + dt^2 kp beside the armature. */
  beginLaw(request) {
    const {view, layout, scene: {dt, robot}} = this, at = layout.in;
    for (let i = 0; i < layout.n; ++i) {
      const kp = request[at.kp + i], kd = request[at.kd + i], v = request[at.v + i];
      this.added[i] = dt * (kd + dt * kp);
      this.drive[i] = kp * (request[at.qTarget + i] - request[at.q + i] - dt * v) - kd * v + request[at.tau + i];
      view.dof_armature[this.v[i]] = robot.joints[i].armature + this.added[i];
      view.qfrc_applied[this.v[i]] = this.drive[i];
    }
  }

  push(request) {
    const {view, layout} = this, from = layout.in.pushes;
    let any = false;
    for (let k = 0; k < 6 * layout.links && !any; ++k) any = request[from + k] !== 0;
    if (!any && !this.pushed) return;
    this.pushed = any;
    for (let link = 0; link < layout.links; ++link) {
      const body = this.bodies[link], f = request.subarray(from + 6 * link, from + 6 * link + 3);
      const p = request.subarray(from + 6 * link + 3, from + 6 * link + 6), R = view.xmat.subarray(9 * body);
      const arm = [0, 1, 2].map((k) => view.xpos[3 * body + k] - view.xipos[3 * body + k] + R[3 * k] * p[0] +
          R[3 * k + 1] * p[1] + R[3 * k + 2] * p[2]);
      for (let k = 0; k < 3; ++k) {
        const [a, b] = [(k + 1) % 3, (k + 2) % 3];
        view.xfrc_applied[6 * body + k] = f[k];
        view.xfrc_applied[6 * body + 3 + k] = arm[a] * f[b] - arm[b] * f[a];
      }
    }
  }

  /** The contacts that have rows, by their geoms. */
  readContacts() {
    if (this.data.ncon === 0) return [];
    const all = this.data.contact, contacts = [];
    for (let i = 0; i < all.size(); ++i) {
      const c = all.get(i);
      if (c.efc_address >= 0)
        contacts.push({geom1: c.geom1, geom2: c.geom2, row: c.efc_address, dim: c.dim, dist: c.dist,
          pos: Array.from(c.pos), frame: Array.from(c.frame), friction: Array.from(c.friction), order: i});
      c.delete();
    }
    all.delete();
    contacts.sort((a, b) => a.geom1 - b.geom1 || a.geom2 - b.geom2 || a.order - b.order);
    if (contacts.length > CONTACTS) throw new Error(`more than ${CONTACTS} contacts in one step`);
    return contacts;
  }

  /** What mj_step1 leaves in the rows of a contact with the human becomes the skin of the capsule. */
  setSkin(contacts, request) {
    if (this.capsules.length === 0 || request[this.layout.in.present] === 0) return;
    const rows = {R: this.data.efc_R, D: this.data.efc_D, aref: this.data.efc_aref, vel: this.data.efc_vel};
    for (const contact of contacts) {
      const first = this.geoms[contact.geom1].side === HUMAN;
      const human = this.geoms[first ? contact.geom1 : contact.geom2];
      if (human.side !== HUMAN) continue;
      const points = contacts.filter((c) => c.geom1 === contact.geom1 && c.geom2 === contact.geom2).length;
      const v = this.velocityOf(human.index, contact.pos, request), sign = first ? -1 : 1, {frame} = contact;
      const along = [0, 1, 2].map((k) => sign * (frame[3 * k] * v[0] + frame[3 * k + 1] * v[1] + frame[3 * k + 2] * v[2]));
      this.setRows(contact, this.scene.capsules[human.index], points, along, rows);
    }
  }

  setRows(contact, skin, points, along, rows) {
    const {dt, options} = this.scene, pyramid = options.cone === 'pyramidal';
    const stiffness = skin.stiffness / points, damping = skin.damping / points + dt * stiffness;
    const R = 1 / Math.max(dt * damping, LEAST_MASS), count = pyramid ? 2 * (contact.dim - 1) : contact.dim;
    for (let k = 0; k < count; ++k) {
      const row = contact.row + k, tangent = k >> 1;
      const rowR = pyramid ? count * R : k === 0 ? R : R / options.impratio;
      const partner = pyramid ? along[0] + (k % 2 === 0 ? 1 : -1) * contact.friction[tangent] * along[1 + tangent]
                              : along[k];
      rows.R[row] = rowR;
      rows.D[row] = 1 / rowR;
      rows.aref[row] = -(rows.vel[row] + partner) / dt - (pyramid || k === 0 ? stiffness * R * contact.dist : 0);
    }
  }

  /** Velocity of the capsule at a point: linear between those of its ends. */
  velocityOf(index, p, request) {
    const from = this.layout.in.capsules + 14 * index, c = request.subarray(from, from + 14);
    const [w, x, y, z] = c.subarray(3, 7), half = c[7];
    const axis = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
    const along = axis.reduce((sum, a, k) => sum + a * (p[k] - c[k]), 0);
    const s = half > 0 ? Math.min(Math.max(0.5 + 0.5 * along / half, 0), 1) : 0;
    return [0, 1, 2].map((k) => c[8 + k] + s * (c[11 + k] - c[8 + k]));
  }

  accelerate() {
    const {mujoco, model, data} = this;
    mujoco.mj_fwdAcceleration(model, data);
    mujoco.mj_fwdConstraint(model, data);
    if (!this.saturate()) return;
    mujoco.mj_factorM(model, data);
    mujoco.mj_fwdAcceleration(model, data);
    mujoco.mj_fwdConstraint(model, data);
  }

  /** A joint that passes its effort gets it, and its armature alone; true where one does. */
  saturate() {
    const {view, scene: {robot: {joints}}} = this;
    let changed = false;
    for (let i = 0; i < joints.length; ++i) {
      const v = this.v[i], torque = this.drive[i] - this.added[i] * view.qacc[v];
      if (Math.abs(torque) <= joints[i].effort) continue;
      this.drive[i] = view.qfrc_applied[v] = Math.sign(torque) * joints[i].effort;
      view.M[view.M_rowadr[v] + view.M_rownnz[v] - 1] -= this.added[i];
      view.dof_armature[v] = joints[i].armature;
      this.added[i] = 0;
      changed = true;
    }
    return changed;
  }

  write(contacts, force, request, answer) {
    const {view, layout, scene: {dt}} = this, {n} = layout, at = layout.out;
    answer.fill(0);
    for (let i = 0; i < 7; ++i) answer[at.state + i] = view.qpos[i];
    for (let i = 0; i < 6; ++i) answer[at.state + 7 + i] = view.qvel[i];
    for (let i = 0; i < n; ++i) {
      const v = view.qvel[this.v[i]];
      answer[at.q + i] = view.qpos[this.q[i]];
      answer[at.v + i] = v;
      answer[at.torques + i] = this.drive[i] - this.added[i] * (v - this.speed[i]) / dt;
    }
    for (let i = 0; i < this.memory; ++i) answer[at.memory + i] = view.qacc_warmstart[i];
    for (let i = 0; i < at.count; ++i) {
      if (Number.isFinite(answer[i]) && !(i >= at.state + 7 && i < at.q && Math.abs(answer[i]) > FASTEST)) continue;
      answer.fill(0);
      answer[0] = 1;
      return at.contacts;
    }
    answer[at.count] = contacts.length;
    contacts.forEach((contact, i) => this.writeContact(contact, force, answer.subarray(at.contacts + 10 * i)));
    return at.contacts + 10 * contacts.length;
  }

  /** MuJoCo's force acts on the second geom's body, in a frame whose rows are the normal and two tangents. */
  writeContact(contact, force, to) {
    const first = this.geoms[contact.geom1], second = this.geoms[contact.geom2];
    const linkIsSecond = first.side !== second.side ? second.side === ROBOT
                                                    : !this.pairs.has(`${first.shape} ${second.shape}`);
    const [robot, other] = linkIsSecond ? [second, first] : [first, second];
    const f = this.forceOf(contact, force), {frame} = contact, sign = linkIsSecond ? 1 : -1;
    to[0] = robot.index;
    to[1] = other.side;
    to[2] = other.index;
    for (let k = 0; k < 3; ++k) {
      to[3 + k] = contact.pos[k];
      to[6 + k] = sign * (frame[k] * f[0] + frame[3 + k] * f[1] + frame[6 + k] * f[2]);
    }
    to[9] = Math.max(0, -contact.dist);
  }

  /** Normal and two tangents. [N] */
  forceOf({row, friction}, force) {
    if (this.scene.options.cone !== 'pyramidal') return [force[row], force[row + 1], force[row + 2]];
    const [a, b, c, d] = [0, 1, 2, 3].map((k) => force[row + k]);
    return [a + b + c + d, friction[0] * (a - b), friction[1] * (c - d)];
  }
}

export async function load(modules) {
  const file = path.join(modules, '@mujoco', 'mujoco', 'mujoco.js');
  const mujoco = await (await import(pathToFileURL(file))).default();
  return {version: mujoco.mj_versionString(), open: (scene) => new World(mujoco, scene)};
}
