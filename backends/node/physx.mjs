// NVIDIA PhysX 5 (physx-js-webidl) as an engine of duet: a reduced-coordinate articulation with PhysX's own drives, armature,
// limits, detector and solver. Single precision. README.md says what maps to what, and what the package cannot do.
import fs from 'node:fs';
import path from 'node:path';
import process from 'node:process';
import {pathToFileURL} from 'node:url';
import {layoutOf} from './layout.mjs';

const CONTACTS = 128;
const GROUND = 0, ROBOT = 2; // duet's ContactSide
const FASTEST = 1e4; // [m/s], [rad/s]: beyond it a step has diverged
const UNLIMITED = 1e6; // of PhysX's own limits of speed
const SUPPRESS = 2; // PxFilterFlag: no contacts for this pair

// Quaternions are [w, x, y, z].
const times = (a, b) => [
  a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
  a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];
const inverse = (a) => [a[0], -a[1], -a[2], -a[3]];
const rotate = (q, v) => times(times(q, [0, ...v]), inverse(q)).slice(1);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const add = (a, b) => a.map((x, i) => x + b[i]);
const unit = (q) => q.map((x) => x / Math.hypot(...q));

/** The rotation that turns x onto a unit vector: PhysX's hinges turn about x. */
function fromX([x, y, z]) {
  return x < -0.999999 ? [0, 0, 0, 1] : unit([1 + x, 0, -z, y]);
}

/** Moments and axes of an inertia (xx, yy, zz, xy, xz, yz) by Jacobi's rotations. */
export function principal([xx, yy, zz, xy, xz, yz]) {
  const A = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
  let q = [1, 0, 0, 0];
  for (let sweep = 0; sweep < 60; ++sweep) {
    const [i, j] = [[0, 1], [0, 2], [1, 2]].reduce((a, b) => Math.abs(A[b[0]][b[1]]) > Math.abs(A[a[0]][a[1]]) ? b : a);
    if (Math.abs(A[i][j]) <= 1e-15 * (Math.abs(A[i][i]) + Math.abs(A[j][j]))) break;
    const angle = 0.5 * Math.atan2(2 * A[i][j], A[i][i] - A[j][j]), c = Math.cos(angle), s = Math.sin(angle);
    for (let k = 0; k < 3; ++k) [A[k][i], A[k][j]] = [c * A[k][i] + s * A[k][j], c * A[k][j] - s * A[k][i]];
    for (let k = 0; k < 3; ++k) [A[i][k], A[j][k]] = [c * A[i][k] + s * A[j][k], c * A[j][k] - s * A[i][k]];
    const axis = 3 - i - j, half = (axis === 1 ? -1 : 1) * angle / 2, turn = [Math.cos(half), 0, 0, 0];
    turn[1 + axis] = Math.sin(half);
    q = times(q, turn);
  }
  return {moments: [A[0][0], A[1][1], A[2][2]], axes: unit(q)};
}

class World {
  constructor(engine, scene) {
    if (scene.partner === 'solid') throw new Error('no solid partner: the package has no damping of compliant contacts');
    Object.assign(this, {engine, P: engine.P, definition: scene, memory: 0, contacts: CONTACTS});
    this.layout = layoutOf(scene, 0);
    this.touching = [];
    this.makeScene();
    this.makeRobot();
    this.makeGround();
    const {P} = this;
    this.drives = scene.robot.joints.map((joint) =>
      new P.PxArticulationDrive(0, 0, joint.effort, P.PxArticulationDriveTypeEnum.eFORCE));
    for (const name of ['stiffness', 'damping', 'torque']) this[name] = new Float64Array(this.layout.n).fill(NaN);
    this.kinematic = new P.PxArticulationKinematicFlags(P.PxArticulationKinematicFlagEnum.ePOSITION |
        P.PxArticulationKinematicFlagEnum.eVELOCITY);
  }

  free() {
    const {P} = this;
    this.scene.removeArticulation(this.body);
    this.body.release();
    this.ground.release();
    this.scene.release();
    for (const own of [...this.drives, this.kinematic])
      P.destroy(own);
  }

  makeScene() {
    const {P, engine, definition} = this, {options} = definition, flag = P.PxSceneFlagEnum;
    const described = new P.PxSceneDesc(engine.scale);
    described.gravity = engine.vector(definition.gravity);
    described.cpuDispatcher = engine.dispatcher;
    described.solverType = options.solver === 'tgs' ? P.PxSolverTypeEnum.eTGS : P.PxSolverTypeEnum.ePGS;
    described.bounceThresholdVelocity = UNLIMITED;
    // What a step leaves for the next one (manifolds, contacts of bodies that rest) must not be: a step is its request.
    described.flags = new P.PxSceneFlags(flag.eDISABLE_CONTACT_CACHE | flag.eENABLE_FRICTION_EVERY_ITERATION |
        flag.eENABLE_ENHANCED_DETERMINISM);
    described.simulationEventCallback = this.listener();
    P.PxTopLevelFunctions.prototype.setupPassThroughFilterShader(described, this.filter());
    this.scene = engine.physics.createScene(described);
    P.destroy(described);
  }

  /** Everything touches the ground, and the declared pairs each other. */
  filter() {
    const {P, definition} = this, flag = P.PxPairFlagEnum;
    const pairs = new Set(definition.self_collision ? definition.robot.self_collision.map(([a, b]) => `${a} ${b}`) : []);
    const shader = new P.PassThroughFilterShaderImpl();
    shader.filterShader = (_a, first, _b, _c, _d, _e, second) => {
      const [a, b] = [Math.min(first, second) - 1, Math.max(first, second) - 1]; // word 0: shape + 1, 0 for the ground
      if (a >= 0 && !pairs.has(`${a} ${b}`)) return SUPPRESS;
      shader.outputPairFlags = flag.eSOLVE_CONTACT | flag.eDETECT_DISCRETE_CONTACT | flag.eNOTIFY_TOUCH_FOUND |
          flag.eNOTIFY_TOUCH_PERSISTS | flag.eNOTIFY_CONTACT_POINTS;
      return 0;
    };
    this.shader = shader;
    return shader;
  }

  listener() {
    const {P} = this, callback = new P.PxSimulationEventCallbackImpl();
    callback.onConstraintBreak = callback.onWake = callback.onSleep = callback.onTrigger = () => {};
    callback.onContact = (_header, pairs, count) => {
      const first = P.wrapPointer(pairs, P.PxContactPair);
      for (let i = 0; i < count; ++i) this.read(P.NativeArrayHelpers.prototype.getContactPairAt(first, i));
    };
    this.callback = callback;
    return callback;
  }

  read(pair) {
    const {points} = this.engine, count = pair.extractContacts(points.data(), points.size());
    const words = [0, 1].map((k) => pair.get_shapes(k).getSimulationFilterData().get_word0());
    for (let i = 0; i < count; ++i) {
      const point = points.at(i), of = (v) => [v.get_x(), v.get_y(), v.get_z()];
      this.touching.push({words, position: of(point.get_position()), normal: of(point.get_normal()),
        impulse: of(point.get_impulse()), separation: point.get_separation(), order: i});
    }
  }

  makeRobot() {
    const {engine, definition: {robot, options}, P} = this, poses = [];
    this.body = engine.physics.createArticulationReducedCoordinate();
    this.body.setArticulationFlag(P.PxArticulationFlagEnum.eDRIVE_LIMITS_ARE_FORCES, true);
    this.body.setSolverIterationCounts(options.position_iterations, options.velocity_iterations);
    this.body.setSleepThreshold(0);
    this.body.setStabilizationThreshold(0);
    this.links = [];
    this.joints = [];
    robot.links.forEach((link, i) => {
      const up = i === 0 ? {p: [0, 0, 0], q: [1, 0, 0, 0]} : poses[link.parent];
      poses.push({p: add(rotate(up.q, link.p), up.p), q: times(up.q, link.quat_wxyz)});
      const made = this.body.createLink(i === 0 ? null : this.links[link.parent], engine.transform(poses[i].p, poses[i].q));
      this.links.push(made);
      this.giveMass(made, link);
      this.giveShapes(made, i);
      if (i > 0) this.joints.push(this.hinge(made.getInboundJoint(), link, robot.joints[i - 1]));
    });
    this.scene.addArticulation(this.body);
  }

  giveMass(made, link) {
    const {engine} = this, {moments, axes} = principal(link.inertia);
    made.setMass(link.mass);
    made.setMassSpaceInertiaTensor(engine.vector(moments));
    made.setCMassLocalPose(engine.transform(link.com, axes));
    made.setLinearDamping(0);
    made.setAngularDamping(0);
    made.setMaxLinearVelocity(UNLIMITED);
    made.setMaxAngularVelocity(UNLIMITED);
  }

  giveShapes(made, index) {
    const {P, engine, definition: {robot, friction}} = this;
    robot.shapes.forEach((shape, i) => {
      if (shape.link !== index) return;
      const geometry = shape.kind === 'sphere' ? new P.PxSphereGeometry(shape.radius)
                                               : new P.PxCapsuleGeometry(shape.radius, shape.half_length);
      const to = engine.physics.createShape(geometry, this.material(friction.robot_robot, 'eAVERAGE'), true);
      to.setLocalPose(engine.transform(shape.p, times(shape.quat_wxyz, fromX([0, 0, 1])))); // PhysX's lie along x
      this.identify(to, i + 1);
      made.attachShape(to);
      to.release();
      P.destroy(geometry);
    });
  }

  identify(shape, word) {
    const {P} = this, data = new P.PxFilterData(word, 0, 0, 0);
    shape.setSimulationFilterData(data);
    shape.setContactOffset(0.005);
    shape.setRestOffset(0);
    P.destroy(data);
  }

  /** Without patches that are kept: a step is its request. */
  material(friction, combine) {
    const {P, engine} = this, material = engine.physics.createMaterial(friction, friction, 0);
    material.setFlag(P.PxMaterialFlagEnum.eDISABLE_STRONG_FRICTION, true);
    material.setFrictionCombineMode(P.PxCombineModeEnum[combine]);
    return material;
  }

  hinge(made, link, joint) {
    const {P, engine} = this, axis = P.PxArticulationAxisEnum.eTWIST, turn = fromX(link.axis);
    made.setParentPose(engine.transform(link.p, times(link.quat_wxyz, turn)));
    made.setChildPose(engine.transform([0, 0, 0], turn));
    made.setJointType(P.PxArticulationJointTypeEnum.eREVOLUTE);
    made.setMotion(axis, P.PxArticulationMotionEnum.eLIMITED);
    const limit = new P.PxArticulationLimit(joint.lower, joint.upper);
    made.setLimitParams(axis, limit);
    P.destroy(limit);
    made.setArmature(axis, joint.armature);
    made.setFrictionCoefficient(0);
    made.setMaxJointVelocity(UNLIMITED);
    return made;
  }

  /** The ground's mode wins over the robot's: friction of the pair is the product, or the greater one of 0. */
  makeGround() {
    const {P, engine, definition: {friction: {robot_robot: robot, robot_ground: ground}}} = this;
    const material = robot > 0 ? this.material(ground / robot, 'eMULTIPLY') : this.material(ground, 'eMAX');
    const plane = new P.PxPlane(0, 0, 1, 0);
    this.ground = P.PxTopLevelFunctions.prototype.CreatePlane(engine.physics, plane, material);
    P.destroy(plane);
    this.identify(P.SupportFunctions.prototype.PxActor_getShape(this.ground, 0), 0);
    this.scene.addActor(this.ground);
  }

  step(request, answer) {
    this.place(request);
    this.drive(request);
    this.push(request);
    this.touching.length = 0;
    this.scene.simulate(this.definition.dt);
    this.scene.fetchResults(true);
    return this.write(request, answer);
  }

  place(request) {
    this.scene.resetFiltering(this.ground); // its pairs are found anew: their order is no longer that of first touches
    const {engine, body, layout: {n, in: at}, definition: {robot}} = this, axis = this.P.PxArticulationAxisEnum.eTWIST;
    const q = Array.from(request.subarray(3, 7)), w = rotate(q, request.subarray(10, 13));
    const arm = rotate(q, robot.links[0].com); // PhysX's velocity of the base is that of its centre of mass
    body.setRootGlobalPose(engine.transform(request.subarray(0, 3), q), true);
    body.setRootLinearVelocity(engine.vector(add(Array.from(request.subarray(7, 10)), cross(w, arm))), true);
    body.setRootAngularVelocity(engine.vector(w), true);
    for (let i = 0; i < n; ++i) {
      this.joints[i].setJointPosition(axis, request[at.q + i]);
      this.joints[i].setJointVelocity(axis, request[at.v + i]);
    }
    body.updateKinematic(this.kinematic);
    body.wakeUp();
  }

  /** Feed-forward is a shift of the drive's target, so that the limit holds for both together. */
  drive(request) {
    const {joints, drives, layout: {n, in: at}, definition: {robot}} = this, axis = this.P.PxArticulationAxisEnum.eTWIST;
    for (let i = 0; i < n; ++i) {
      const kp = request[at.kp + i], kd = request[at.kd + i], tau = request[at.tau + i], {effort} = robot.joints[i];
      if (kp !== this.stiffness[i] || kd !== this.damping[i]) {
        drives[i].set_stiffness(this.stiffness[i] = kp);
        drives[i].set_damping(this.damping[i] = kd);
        joints[i].setDriveParams(axis, drives[i]);
      }
      joints[i].setDriveTarget(axis, request[at.qTarget + i] + (kp > 0 ? tau / kp : 0), true);
      joints[i].setDriveVelocity(axis, kp === 0 && kd > 0 ? tau / kd : 0, true);
      this.torque[i] = kp === 0 && kd === 0 ? Math.min(Math.max(tau, -effort), effort) : 0;
    }
  }

  /** Pushes, and torques of joints without a drive as a pair on their two links. */
  push(request) {
    const {engine, links, layout: {in: at}, definition: {robot}} = this;
    let any = this.torque.some((torque) => torque !== 0);
    for (let k = 0; k < 6 * links.length && !any; ++k) any = request[at.pushes + k] !== 0;
    if (!any) return;
    const moments = robot.links.map(() => [0, 0, 0]), pushed = robot.links.map(() => null);
    for (let i = 0; i < links.length; ++i) {
      const values = Array.from(request.subarray(at.pushes + 6 * i, at.pushes + 6 * i + 6)), force = values.slice(0, 3);
      const torque = i === 0 ? 0 : this.torque[i - 1];
      if (torque === 0 && force.every((f) => f === 0)) continue;
      const pose = links[i].getGlobalPose(), turn = pose.get_q();
      const q = [turn.get_w(), turn.get_x(), turn.get_y(), turn.get_z()];
      pushed[i] = force;
      moments[i] = add(moments[i], cross(rotate(q, add(values.slice(3), robot.links[i].com.map((x) => -x))), force));
      if (torque === 0) continue;
      const axis = rotate(q, robot.links[i].axis);
      moments[i] = add(moments[i], axis.map((x) => torque * x));
      moments[robot.links[i].parent] = add(moments[robot.links[i].parent], axis.map((x) => -torque * x));
    }
    links.forEach((link, i) => {
      if (pushed[i] !== null && pushed[i].some((f) => f !== 0)) link.addForce(engine.vector(pushed[i]));
      if (moments[i].some((m) => m !== 0)) link.addTorque(engine.vector(moments[i]));
    });
  }

  write(request, answer) {
    const {body, joints, layout: {n, in: from, out: at}, definition: {robot, dt}} = this;
    const axis = this.P.PxArticulationAxisEnum.eTWIST;
    answer.fill(0);
    const pose = body.getRootGlobalPose(), p = pose.get_p(), turn = pose.get_q();
    const place = [p.get_x(), p.get_y(), p.get_z()], q = unit([turn.get_w(), turn.get_x(), turn.get_y(), turn.get_z()]);
    const linear = this.read3(body.getRootLinearVelocity()), w = this.read3(body.getRootAngularVelocity());
    const arm = rotate(q, robot.links[0].com);
    const state = [...place, ...q, ...add(linear, cross(w, arm).map((x) => -x)), ...rotate(inverse(q), w)];
    answer.set(state, at.state);
    for (let i = 0; i < n; ++i) {
      const angle = joints[i].getJointPosition(axis), v = joints[i].getJointVelocity(axis), {effort} = robot.joints[i];
      answer[at.q + i] = angle;
      answer[at.v + i] = v;
      const torque = request[from.kp + i] * (request[from.qTarget + i] - angle) - request[from.kd + i] * v + request[from.tau + i];
      answer[at.torques + i] = Math.min(Math.max(torque, -effort), effort);
    }
    if (!this.isSane(answer)) {
      answer.fill(0);
      answer[0] = 1;
      return at.contacts;
    }
    const contacts = this.reported(dt);
    answer[at.count] = contacts.length;
    contacts.forEach((contact, i) => answer.set(contact, at.contacts + 10 * i));
    return at.contacts + 10 * contacts.length;
  }

  isSane(answer) {
    const {layout: {n, out: at}} = this, slow = (i) => Math.abs(answer[i]) < FASTEST;
    for (let i = at.state; i < at.count; ++i) if (!Number.isFinite(answer[i])) return false;
    for (let i = 0; i < 6; ++i) if (!slow(at.state + 7 + i)) return false;
    for (let i = 0; i < n; ++i) if (!slow(at.v + i)) return false;
    return true;
  }

  read3(v) {
    return [v.get_x(), v.get_y(), v.get_z()];
  }

  /** PhysX's impulse acts on its first shape, along the normal; friction is not in the package's report. */
  reported(dt) {
    const {definition: {robot: {shapes}}} = this, contacts = [];
    for (const {words: [first, second], position, impulse, separation, normal, order} of this.touching) {
      if (separation > 0 && impulse.every((x) => x === 0)) continue;
      const swapped = first === 0 || (second !== 0 && second < first);
      const [own, other] = swapped ? [second, first] : [first, second], sign = swapped ? -1 : 1;
      const middle = position.map((x, k) => x - 0.5 * separation * normal[k]); // of the overlap
      contacts.push({own, other, order, numbers: [shapes[own - 1].link, other === 0 ? GROUND : ROBOT,
        other === 0 ? -1 : shapes[other - 1].link, ...middle, ...impulse.map((x) => sign * x / dt), Math.max(0, -separation)]});
    }
    contacts.sort((a, b) => a.own - b.own || a.other - b.other || a.order - b.order);
    if (contacts.length > CONTACTS) throw new Error(`more than ${CONTACTS} contacts in one step`);
    return contacts.map(({numbers}) => numbers);
  }
}

/** The package looks for a browser or for Node by `process`, and refuses Node: hidden while it loads. */
async function loadPackage(modules) {
  const folder = path.join(modules, 'physx-js-webidl');
  const hidden = globalThis.process;
  const module = await import(pathToFileURL(path.join(folder, 'physx-js-webidl.mjs')));
  const wasmBinary = fs.readFileSync(path.join(folder, 'physx-js-webidl.wasm'));
  Object.assign(globalThis, {window: globalThis, self: globalThis, document: {currentScript: null},
    location: {href: 'file:///host'}});
  globalThis.process = undefined;
  try {
    return await module.default({wasmBinary, locateFile: (name) => name});
  } finally {
    globalThis.process = hidden ?? process;
  }
}

export async function load(modules) {
  const P = await loadPackage(modules), top = P.PxTopLevelFunctions.prototype, number = P.PHYSICS_VERSION;
  const foundation = top.CreateFoundation(number, new P.PxDefaultAllocator(), new P.PxDefaultErrorCallback());
  const scale = new P.PxTolerancesScale(), vectors = new P.PxVec3(0, 0, 0);
  const place = new P.PxTransform(P.PxIDENTITYEnum.PxIdentity);
  const vector = (v, to = vectors) => {
    to.set_x(v[0]);
    to.set_y(v[1]);
    to.set_z(v[2]);
    return to;
  };
  const engine = {
    P, scale, vector, physics: top.CreatePhysics(number, foundation, scale), dispatcher: top.DefaultCpuDispatcherCreate(0),
    points: new P.Vector_PxContactPairPoint(64),
    /** Valid until the next call: PhysX copies what it is given. */
    transform(p, q) {
      vector(p, place.get_p());
      const turn = place.get_q();
      for (const [k, name] of ['w', 'x', 'y', 'z'].entries()) turn[`set_${name}`](q[k]);
      return place;
    },
  };
  return {version: `${number >>> 24}.${(number >>> 16) & 255}.${(number >>> 8) & 255}`, open: (scene) => new World(engine, scene)};
}
