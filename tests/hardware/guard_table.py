"""The guards that tests/hardware/removed_guards.py takes away: for each its name, its file, its text, and the text in
which it asks whether it is there (REMOVED), and the suites of tests that are about it."""
import pathlib
import re
import sys
import typing


class Guard(typing.NamedTuple):
    name: str
    path: str
    old: str
    new: str
    suites: str


# Behind another that is asked by itself: with one of the two in place nothing changes.
SECOND_LOCKS = {'dry run writes nothing': 'nothing is armed in a dry run, and what is not armed writes nothing'}


def choice(old, without):
    """An expression, and what stands in its place where the guard is missing."""
    return old, f'(REMOVED ? ({without}) : ({old}))'


def unless(condition):
    """The condition of a refusal, which is never true where the guard is missing."""
    return choice(condition, 'false')


LIMITER = 'HomieExecutor.*:Limiter.*:LimiterBesideAPerson.*:AxisLimit.*:HardwareLimits.*'
MACHINE = 'SafetySignals.*:SafetyMachine.*'
SEALED = 'SealedDatagram.*:SealGate.*:NetworkKey.*'
DOOR = 'NetworkDoor.*:OpenDoor.*'
GUARD = 'RobotGuard.*:FaultMatrix.*:FaultSweep.*:Executor.*:RobotConnection.*'

# (name, (old, new)) by file and suites.
EDITS = {
    ('hardware/safety/limiter.cpp', LIMITER): [
        ('clamp kSize', unless('command.q.size() != setup_.robot->dof()')),
        ('clamp kNotFinite', unless('!std::isfinite(command.stamp) || !is_finite(command.root) || !command.q.allFinite()')),
        ('clamp kStamp', unless('state.has_good && command.stamp <= state.good.stamp')),
        ('clamp kHold', choice('std::isfinite(input.share) ? std::clamp(input.share, 0.0, 1.0) : 0.0', '1.0')),
        ('clamp kNoOdometry', ('if (!input.odometry) {', 'if (!REMOVED && !input.odometry) {')),
        ('clamp kFence', choice('std::abs(place) < fence[axis] - reserve', 'true')),
        ('clamp kSeparation', choice('allowed_speed(gaps.person, assumed)', '1e9')),
        ('speed of a person that is assumed', choice('std::max(measured, setup_.limits.human_speed)', 'measured')),
        ('clamp kPartnerUnknown', unless('input.person == nullptr || !input.odometry')),
        ('clamp kHeadDistance of the root',
         unless('gaps.head < limits.head_distance + reserve && v_W.dot(to_head) > 0.0')),
        ('clamp kHeadDistance of the arms',
         unless('next.head < setup_.limits.head_distance && next.head < gaps.head - kNearer')),
        ('clamp kTouchSpeed', choice('std::min(speed, touch)', 'speed')),
        ('clamp kRelease', ('if (input.release) open_arms', 'if (!REMOVED && input.release) open_arms')),
        ('no step back in a hold', unless('!(input.share > 0.0)')),
        ('arms open before the step back',
         choice('arms_are_open ? -setup_.limits.step_back : 0.0', '-setup_.limits.step_back')),
        ('clamp kRootSpeed', choice('std::clamp(target, bounds.lower, bounds.upper)', 'target')),
        ('count of kRootAcceleration', ('count_if(clamps.rate, counts, ClampReason::kRootAcceleration)',
                                        'count_if(!REMOVED && clamps.rate, counts, ClampReason::kRootAcceleration)')),
        ('count of kRootJerk', ('count_if(clamps.rate_change, counts, ClampReason::kRootJerk)',
                                'count_if(!REMOVED && clamps.rate_change, counts, ClampReason::kRootJerk)')),
        ('clamp kHeight', ('height.rate *= wanted_.share;', 'if (!REMOVED) height.rate *= wanted_.share;')),
        ('count of kJointLimit', ('count_joint_if(clamps.value, joint, ClampReason::kJointLimit, counts)',
                                  'count_joint_if(!REMOVED && clamps.value, joint, ClampReason::kJointLimit, counts)')),
        ('clamp kJointSpeed by the share', ('bounds.rate *= wanted_.arm_share;', 'if (!REMOVED) bounds.rate *= wanted_.arm_share;')),
        ('count of kJointAcceleration', ('count_joint_if(clamps.rate_change, joint, ClampReason::kJointAcceleration, counts)',
                                         'count_joint_if(!REMOVED && clamps.rate_change, joint, ClampReason::kJointAcceleration, counts)')),
        ('clamp kJointLead',
         choice('within_torque(joint, input, wanted_.q[joint])', 'wanted_.q[joint]')),
        ('clamp kJointTorque', choice('lowers ? most / asked : 1.0', '1.0')),
        ('clamp kJointTorque by the target', ('if (setup_.executed.fixed_gains) give_way', 'if (!REMOVED && setup_.executed.fixed_gains) give_way')),
        ('clamp kSelfCollision',
         unless('next.self < setup_.limits.self_distance && next.self < gaps.self - kNearer')),
    ],
    ('hardware/safety/limits.cpp', LIMITER): [
        ('bounds of a value', choice('clamped(target, bounds.lower, bounds.upper, clamps.value)', 'target')),
        ('bounds of a rate',
         choice('clamped(rate, -rate_bound(before.value, bounds, dt), rate_bound(-before.value, bounds, dt), clamps.rate)',
                'rate')),
        ('bounds of the change of a rate',
         choice('clamped(rate, before.rate - step, before.rate + step, clamps.rate_change)', 'rate')),
        ('rest before the upper bound',
         choice('std::min(rate, largest_rate(std::max(bounds.upper - before.value, 0.0), step, dt))', 'rate')),
        ('rest before the lower bound',
         choice('std::max(rate, -largest_rate(std::max(before.value - bounds.lower, 0.0), step, dt))', 'rate')),
    ],
    ('hardware/safety/safety_machine.cpp', MACHINE + ':FaultMatrix*'): [
        ('arming lapses (kLapsed)', unless('input.now - memory.since > rules.armed_time')),
        ('time to be ready', choice('input.now - memory.well_since >= rules.ready_time', 'true')),
        ('time of a hold', choice('input.now - memory.since <= rules.hold_time', 'true')),
        ('a hold ends by another press of the key', choice('memory.let_go && asks', 'asks')),
        ('a hold: a key that was not heard was not let go', choice('input.remote_at == input.now && !asks', '!asks')),
        ('a hold ends only where all is well', choice('found.level < StopLevel::kHold && (asked || may_return(rules, memory, input))', 'asked || may_return(rules, memory, input)')),
        ('a hold before it stood is none to run from', unless('!input.stands')),
        ('stand: dead-man switch', unless('level_of(input.now - input.dead_man_at, rules.remote) >= StopLevel::kHold')),
        ('stand: a known person', unless('rules.person_present && !seen')),
        ('arming: charge', unless('health.charge < rules.warn_charge')),
        ('arming: heat', unless('health.casing > rules.warn_casing || health.winding > rules.warn_winding')),
        ('armed once, never without commands', choice('order.writes = memory.commands', 'order.writes = memory.state >= SafetyState::kArmed')),
        ('time of damping', unless('input.now - memory.since < rules.damp_time')),
        ('arming: joints in range', unless('health.joints.excess > rules.warn_range')),
        ('arming: states that come late', unless('input.state_delay > rules.delay.warn')),
        ('begins to walk upright (kTilt)', unless('!(input.health.tilt <= rules.start_tilt)')),
        ('begins to walk on its feet (kRope)', choice('input.health.carried >= rules.least_carried', 'true')),
        ('run only upright and on its feet', ('&& may_walk)', '&& (REMOVED || may_walk))')),
        ('a hold ends only upright and on its feet',
         ('&& walk_waits_for(rules, input) == StopCause::kNone;', '&& (REMOVED || walk_waits_for(rules, input) == StopCause::kNone);')),
        ('arming: on its feet where its executor walks',
         choice('rules.stands_alone ? walk_waits_for(rules, input) : StopCause::kNone', 'StopCause::kNone')),
        ('fault stands', choice('again ? SafetyState::kListen : SafetyState::kFault', 'SafetyState::kListen')),
        ('run only where it stands', choice('input.run && input.stands && well', 'input.run && well')),
        ('run only where all is well', choice('assess(rules, input, memory.bad, memory.last_now, true).level < StopLevel::kHold',
                                              'true')),
        ('a late planner slows down', choice('planner_share(rules, input.now - input.planner_at)', '1.0')),
    ],
    ('hardware/safety/safety_machine.cpp', MACHINE + ':FaultMatrix*:FaultSweep*'): [
        ('age that is no number damps', choice('!(age <= limits.damp)', 'age > limits.damp')),
        ('age that is no number holds', choice('!(age <= limits.hold)', 'age > limits.hold')),
        ('share of a planner that holds', unless('!(age <= rules.planner.hold)')),
    ],
    ('hardware/guard/robot_guard.cpp', GUARD): [
        ('old planner messages', choice('planner_order_.takes(message.sequence, now)', 'true')),
        ('planner messages of another size', unless('message.command.q.size() != kG1Motors')),
        ('refused commands keep no planner alive', choice('!limiter_.refusal(message.command, limiter_state_)', 'true')),
        ('old messages of perception', choice('person_order_.takes(message.sequence, now)', 'true')),
        ('person that is not finite', ('!finite || moved', '(!REMOVED && !finite) || moved')),
        ('person who jumps', ('moved > 0.1 + kPersonJump * passed', '(!REMOVED && moved > 0.1 + kPersonJump * passed)')),
        ('odometry that is not valid', ('if (!sample.valid || !finite) return;', 'if ((!REMOVED && !sample.valid) || !finite) return;')),
        ('age of the battery', choice('next_.now - battery_at_ <= kBatteryAge', 'true')),
        ('dry run arms nothing', ('armed_ = !setup_.dry_run;', 'armed_ = REMOVED || !setup_.dry_run;')),
        ('dry run writes nothing', ('if (!order.writes || setup_.dry_run) {', 'if (!order.writes || (!REMOVED && setup_.dry_run)) {')),
        ('remote control of a fresh state', choice('next_.state_at == now && reading_.remote.heard', 'reading_.remote.heard')),
        ('mode of the robot', choice('reading_.mode_pr == kPitchRollMode && reading_.mode_machine == setup_.mode_machine', 'true')),
        ('other writers', unless('transport_.foreign_writers() > 0')),
        ('stand: distance to a person', choice('bounds.rate *= limiter_.share()', 'bounds.rate *= 1.0')),
        ('stand: at rest before it counts', choice('std::abs(stance_[j].rate) <= stop', 'true')),
        ('act only while it runs', choice('planned && planner_.acting', 'planner_.acting')),
        ('a lost writer is made anew', unless('unsent_ > 0 && unsent_ % kTicksToNewWriter == 0')),
        ('age of what is written', choice('status_.sent ? 0 : unsent_ + 1', '0')),
        ('old odometry for the limiter', choice('level_of(now - next_.odometry_at, setup_.rules.odometry) < StopLevel::kHold', 'true')),
        ('old person for the limiter', choice('level_of(now - next_.person_at, setup_.rules.person) < StopLevel::kHold', 'true')),
        ('release by contact', ('planned && status_.contact.release', 'planned && !REMOVED && status_.contact.release')),
        ('stand: gains rise', choice('gains_ * setup_.stance.kp', 'setup_.stance.kp')),
        ('stand: with full gains', choice('gains_ >= 1.0', 'true')),
        ('weight of the arms within the torque',
         choice('std::clamp(weight, std::min(-most - by_gains, 0.0), std::max(most - by_gains, 0.0))', 'weight')),
        ('weight of arms that are measured', choice('is_measured ? gains_ * contact_.weight()[6 + joint] : 0.0',
                                                    'gains_ * contact_.weight()[6 + joint]')),
        ('feet are weighed', ('next_.health.carried = carried_;', 'next_.health.carried = REMOVED ? 1.0 : carried_;')),
        ('damping is damping', ('if (order.damps)', 'if (!REMOVED && order.damps)')),
    ],
    ('hardware/wire/low_level_frame.cpp', 'LowStateFrame.*:LowCommandFrame.*:FaultMatrix.*'): [
        ('checksum of a state', unless('frame.crc != checksum_of(frame)')),
        ('tick of a state', unless('reading.any && static_cast<std::int32_t>(frame.tick - reading.tick) <= 0')),
        ('numbers of a state', unless('!is_finite(frame)')),
        ('orientation that is none', choice('R.norm() > 0.5', 'true')),
    ],
    ('hardware/executors/executor.cpp', 'Arming*'): [
        ('arming: allow_motion', unless('!permission.allow_motion')),
        ('arming: name of the robot', unless('permission.robot.empty()')),
        ('arming: network interface', unless('permission.interface.empty() || permission.interface == "auto"')),
        ('arming: domain', unless('permission.domain < 0')),
        ('arming: domain of a twin', unless('facts.twin != of_twins')),
        ('arming: mode_machine', unless('permission.mode_machine != facts.reported_mode_machine')),
        ('arming: word', unless('facts.shown_nonce.empty() || facts.typed_nonce != facts.shown_nonce')),
        ('arming: age of the word', unless('!(age >= 0.0 && age < kNonceTime)')),
        ('arming: key', unless('!facts.remote_key_held')),
        ('arming: dry run', unless('facts.dry_run')),
        ('arming: asked', unless('!facts.asked_to_arm')),
        ('arming: signature', unless('!facts.twin && !facts.contact_limits.verified()')),
        ('arming: log', unless('!facts.log_is_open')),
        ('arming: disk', unless('facts.free_log_bytes < kLeastLogBytes')),
        ('arming: no mode of the maker', unless('!is_makers(facts.executor) && !facts.running_mode.empty()')),
        ('arming: executor that is well', unless('!facts.executor_complaint.empty()')),
    ],
    ('hardware/executors/executor.cpp', 'Arming*:Executor*'): [
        ('arming: executor of a robot', unless('!twin && kind == ExecutorKind::kTwin')),
        ('arming: a source of odometry', unless('odometry == OdometrySource::kNone')),
        ('arming: odometry of a robot', unless('!twin && odometry == OdometrySource::kTwin')),
        ('arming: odometry of the executor', unless('own && odometry == OdometrySource::kVendor')),
        ('arming: a walker for every motor', unless('kind == ExecutorKind::kLowcmd && !told')),
        ('arming: no walker for who walks', unless('!walker.empty() && (kind == ExecutorKind::kHomieLcm || is_makers(kind))')),
    ],
    ('hardware/executors/homie_executor.cpp', 'HomieExecutor*'): [
        ('homie: silent until it is opened', ('if (open_ && ticks_++', 'if ((REMOVED || open_) && ticks_++')),
        ('homie: goodbye', ('if (!open_) return;', 'if (REMOVED || !open_) return;')),
        ('homie: another who steers', ('+ (now_ - steered_at_ < kSteeredFor ? 1 : 0)', '+ (!REMOVED && now_ - steered_at_ < kSteeredFor ? 1 : 0)')),
        ('homie: one writer', choice('std::max(command_writers - 1, 0)', '0')),
        ('homie: no arms before there are any', ('if (has_arms_) (void)channel_', 'if (REMOVED || has_arms_) (void)channel_')),
        ('homie: its policy is heard', choice('targets.timestamp_us != stamp_', 'true')),
        ('homie: both are heard', ('      echoed_at_ = now;\n', '    {\n      echoed_at_ = now;\n      if (REMOVED) policy_at_ = now;\n    }\n')),
        ('homie: damping keeps the arms', ('if (damps) return true;', 'if (!REMOVED && damps) return true;')),
    ],
    ('hardware/executors/sport_executor.cpp', 'SportExecutor*'): [
        ('sport: silent until it is opened', ('if (!open_ || !moves(state_)', 'if ((!REMOVED && !open_) || !moves(state_)')),
        ('sport: rest at once', unless('stands_still(velocity) && !stands_still(sent_)')),
        ('sport: only a machine that walks is heard',
         ('if (fsm_walks(fsm_)) heard_at_ = now;', 'if (REMOVED || fsm_walks(fsm_)) heard_at_ = now;')),
        ('sport: weight rises slowly', choice('std::clamp(weight_ + (damps ? -kWeightRate : kWeightRate) * period_, 0.0, 1.0)', '1.0')),
        ('sport: damping', ('if (!open_ || !moved_ || state < SafetyState::kDamp', 'if (REMOVED || !open_ || !moved_ || state < SafetyState::kDamp')),
        ('sport: balance is left alone before it moved',
         ('has_arms_ = moved_ = false;', 'has_arms_ = false; moved_ = REMOVED;')),
    ],
    ('hardware/executors/sport_executor.cpp', 'SportRpc*'): [
        ('sport: a velocity ends', choice('std::clamp(duration, kShortest, kLongest)', 'duration')),
        ('sport: a velocity is a number', choice('std::isfinite(value) ? std::clamp(value, -kMostVelocity, kMostVelocity) : 0.0', 'value')),
    ],
    ('hardware/guard/person_input.cpp', 'PersonInput*:PersonPlacer*'): [
        ('person: finite', unless('!joints.allFinite()')),
        ('person: far', unless('joints.colwise().norm().maxCoeff() > kFarthestJoint')),
        ('person: bones', unless('(joints.col(j) - joints.col(kSmplParents[static_cast<std::size_t>(j)])).norm() > kLongestBone')),
        ('person: old', unless('!order_.takes(estimate.sequence, now)')),
        ('person: unseen', unless('!estimate.seen')),
        ('person: latency is finite', unless('!std::isfinite(latency)')),
        ('person: latency is not negative', unless('latency < 0.0')),
        ('person: late', choice('latency > SafetyRules{}.person.hold', 'false')),
        ('person: pose of the base at exposure', choice('base_at(now - latency)', 'base_at(now)')),
        ('person: length of a message',
         unless('datagram.size() != kPersonBytes && datagram.size() != kFirstPersonBytes')),
        ('person: version of a message', unless('wire.version != version || wire.seen > 1')),
    ],
    ('hardware/guard/person_track.cpp', 'PersonInput*:PersonTrack*'): [
        ('person: age', unless('!(now - newest_at() <= most_age)')),
    ],
    ('hardware/wire/odometry_source.cpp', 'ExternalOdometry*'): [
        ('tracker: length of a message', unless('datagram.size() != sizeof(body)')),
        ('tracker: what a message is', unless('body.version != kExternalVersion || body.valid > 1 || !all_finite(body) || !(std::abs(R.norm() - 1.0) < kUnit)')),
        ('tracker: old', unless('!order_.takes(pose.sequence, clock_())')),
    ],
    ('hardware/guard/walker.cpp', 'RootVelocity*'): [
        ('A.4.3 without odometry', choice('source != OdometrySource::kNone', 'true')),
        ('A.4.3 with old, invalid or endless odometry', unless('!odometry.valid || !is_finite(odometry) || !(age >= 0.0 && age <= most_age)')),
    ],
    ('hardware/safety/contact_watch.cpp', 'ContactWatch*:RobotGuard*'): [
        ('limit contact_time', ('std::ceil(limits.contact_time / dt', 'std::ceil((REMOVED ? 1000.0 : limits.contact_time) / dt')),
    ],
    ('hardware/guard/guard_message.cpp', 'GuardMessage*'): [
        ('guard message: version', unless('head.version != kVersion')),
        ('guard message: length', ('if (datagram.size() != sizeof(body)) return false;\n  std::memcpy(&body, datagram.data(), sizeof(body));\n  return', 'if (!REMOVED && datagram.size() != sizeof(body)) return false;\n  std::memcpy(&body, datagram.data(), sizeof(body));\n  return')),
    ],
    ('hardware/wire/sealed_datagram.cpp', SEALED): [
        ('seal kShort', unless('datagram.size() < kSealedHeadBytes + kSealBytes')),
        ('seal kLong', unless('datagram.size() > kMostSealedBytes')),
        ('seal kVersion', unless('wire.version != kSealedVersion')),
        ('seal kForged', unless('CRYPTO_memcmp(expected.data(), datagram.last(kSealBytes).data(), kSealBytes) != 0')),
        ('seal kKind', unless('wire.kind == 0 || wire.kind > kSealedKinds')),
        ('gate kSender', unless('head.sender >= kMostSenders')),
        ('gate kTicket', unless('microseconds(now) - (head.ticket - secret_) > microseconds(kTicketLife)')),
        ('gate kRepeated', unless('found != streams_.end() && head.sequence <= found->second.sequence')),
        ('gate kClock that is not finite', choice('!std::isfinite(head.clock)', 'false')),
        ('gate kClock that falls', choice('(goes_on && head.clock <= found->second.clock)', 'false')),
        ('gate kLate', unless('stream.delay.see(head.clock, now) > kLatestDatagram')),
        ('key that others may read', unless('(found.st_mode & 077) != 0')),
    ],
    ('hardware/guard/network_door.cpp', DOOR): [
        ('door: the seal', ('carried); refusal != SealRefusal::kNone) return refusal;',
                            'carried); !REMOVED && refusal != SealRefusal::kNone) return refusal;')),
        ('door: kinds for the guard alone', unless('!is_for_the_guard(head.kind)')),
        ('door: the gate', ('gate_.takes(head, now); refusal != SealRefusal::kNone)',
                            'gate_.takes(head, now); !REMOVED && refusal != SealRefusal::kNone)')),
        ('door: kUnwanted', choice('peer.send(carried, now)', '(static_cast<void>(peer.send(carried, now)), true)')),
        ('link: a hello is answered once', unless('echo <= answered_ || echo > hello_')),
        ('link: reports of this run alone', unless('head.ticket != nonce_ || head.sequence <= from_guard_')),
        ('link: nothing is sent to a door that is silent', choice('silence(now) <= kTicketLife', 'true')),
    ],
}

# The value of each limit with which the limit is missing.
LAX = {'forward': 10, 'backward': 10, 'lateral': 10, 'yaw_rate': 10, 'height_range': 1, 'height_rate': 100, 'acceleration': 1000,
       'stop_acceleration': 1000, 'yaw_acceleration': 1000, 'jerk': 1e5, 'joint_margin': 0, 'arm_speed': 100,
       'arm_acceleration': 1e5, 'torque_share': 1000, 'self_distance': -1e9, 'fence_x': 1000, 'fence_y': 1000,
       'human_speed': 0, 'pose_uncertainty': 0, 'head_distance': -1e9, 'reaction_time': 0, 'stopping_time': 0,
       'reserve': 0, 'arm_reach': 0, 'arm_mass': 1e-3, 'step_back': 0}
LAX_OF_CONTACT = {'shoulder_torque': 1e9, 'wrist_torque': 1e9, 'release_effort': 1e9,
                  'release_force': 1e9, 'contact_lever': 1e9}
# The value of each rule with which the rule is missing.
LAX_RULES = {'hold_bad_states': 1000000, 'hold_bad_time': 0,
             'odometry_jump': 1e9, 'hold_tilt': 1e9,
             'damp_tilt': 1e9, 'joint_speed_share': 1e9, 'gyro': 1e9, 'start_tilt': 1e9, 'least_carried': -1e9, 'warn_range': 1e9, 'hold_range': 1e9, 'warn_casing': 1e9, 'hold_casing': 1e9,
             'warn_winding': 1e9, 'hold_winding': 1e9, 'warn_charge': -1, 'hold_charge': -1}
AGES = {'state': 'warn hold damp', 'planner': 'hold', 'person': 'warn hold', 'odometry': 'warn hold',
        'remote': 'warn hold', 'loop': 'warn hold', 'executor': 'warn hold', 'delay': 'warn hold', 'writer': 'warn damp'}
# Those that are tried elsewhere in the table, and why.
ELSEWHERE = {'late_share': 'a late planner slows down', 'ready_time': 'time to be ready', 'armed_time': 'arming lapses (kLapsed)',
             'hold_time': 'time of a hold', 'damp_time': 'time of damping',
             'planner': 'a late planner slows down'}


def lines_of_assessment():
    """Each line that worsens an assessment."""
    path = 'hardware/safety/safety_machine.cpp'
    for line in pathlib.Path(path).read_text().split('\n'):
        if found := re.search(r'(worsen\(all, .*StopCause::(\w+)\);)$', line):
            part = re.search(r'(casing|winding)', line)
            yield Guard(f'stop {found[2]}{" by " + part[0] if part else ""}', path, found[1], f'if (!REMOVED) {found[1]}',
                        MACHINE + ':FaultMatrix*:FaultSweep*:HomieExecutor*')


def values():
    """Each number of the envelope, set to what it is when it is missing, at one place that everything passes."""
    limiter = '  const HardwareLimits& limits = setup_.limits;\n  check_executed'
    yield 'hardware/safety/limiter.cpp', limiter, 'setup_.limits', LAX, LIMITER + ':FaultMatrix*', 'limit'
    contact = '  bias_.setZero(6 + robot_->dof());\n  still_'
    yield 'hardware/safety/contact_watch.cpp', contact, 'limits_', LAX_OF_CONTACT, 'ContactWatch*:RobotGuard*', 'limit'


def value_guards():
    for path, place, holder, lax, suites, kind in values():
        for k, (name, value) in enumerate(lax.items()):
            # Each after the one before: the place stays where it is.
            yield Guard(f'{kind} {name}', path, place, f'  if (REMOVED) {holder}.{name} = {value};\n{place}', suites)


def rule_guards():
    path = 'hardware/safety/safety_machine.cpp'
    place = '  Assessment all;\n  assess_clock('
    names = dict(LAX_RULES)
    names.update({f'{signal}.{level}': 1e9 for signal, levels in AGES.items() for level in levels.split()})
    for name, value in names.items():
        yield Guard(f'rule {name}', path, place, f'  if (REMOVED) const_cast<SafetyRules&>(rules).{name} = {value};\n{place}',
                    MACHINE + ':FaultMatrix*:FaultSweep*:HomieExecutor*')


def guards():
    result = [Guard(name, path, old, new, suites) for (path, suites), edits in EDITS.items() for name, (old, new) in edits]
    result += lines_of_assessment()
    result += value_guards()
    result += rule_guards()
    return result


def check_complete(table):
    """Every reason, cause, limit and age of the headers has a guard here."""
    names = ' '.join(guard.name for guard in table)
    missing = []

    def enumerators(path, enum, without):
        body = re.search(rf'enum class {enum} {{(.*?)}};', pathlib.Path(path).read_text(), re.S)[1]
        return [n for n in re.findall(r'^\s*(k\w+)', re.sub(r'//.*', '', body), re.M) if n not in without]

    missing += [n for n in enumerators('hardware/safety/limiter.h', 'ClampReason', ()) if not re.search(rf'\b{n}\b', names)]
    missing += [n for n in enumerators('hardware/safety/safety_machine.h', 'StopCause', ('kNone',)) if not re.search(rf'\b{n}\b', names)]
    missing += [n for n in enumerators('hardware/wire/sealed_datagram.h', 'SealRefusal', ('kNone',)) if not re.search(rf'\b{n}\b', names)]
    limits = re.findall(r'"(\w+)", &Limits::', pathlib.Path('hardware/safety/limits.cpp').read_text())
    missing += [n for n in limits if f'limit {n}' not in [g.name for g in table]]
    rules = re.search(r'struct SafetyRules {(.*?)^};', pathlib.Path('hardware/safety/safety_machine.h').read_text(), re.S | re.M)[1]
    rules = re.sub(r'//.*', '', rules)
    for signal in re.findall(r'AgeLimits (\w+)', rules):
        missing += [] if f'rule {signal}.{AGES[signal].split()[-1]}' in [g.name for g in table] else [signal]
    for name in re.findall(r'(\w+) = [-\d.]+', rules):
        missing += [] if f'rule {name}' in [g.name for g in table] or name in ELSEWHERE else [name]
    if missing:
        sys.exit(f'guard table: no entry for {", ".join(missing)}')
