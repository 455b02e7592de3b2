// PAIR on the ground: the modes `grounded` and `best`, their terms, plan, legs and the partner's arms.
#include <gmock/gmock.h>

#include <array>
#include <thread>
#include <vector>

#include "duet/motion/human_motion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/retarget/ground_plan.h"
#include "duet/retarget/pair_chain.h"
#include "duet/retarget/pair_terms.h"
#include "duet/retarget/solver/pair.h"
#include "duet/retarget/solver/pair_solver.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

PairOptions mode(PairMode mode) { return pair_options_of(mode); }

PairVariables random_above_legs(const PairProblem& problem, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-0.4, 0.4);
  PairVariables x = PairVariables::zero(problem.chain.dof(), problem.frames());
  for (double& value : x.frames.reshaped()) value = uniform(engine);
  x.frames.middleRows(problem.chain.dof(), 3).setZero();
  x.frames.bottomRows(3).setZero();
  x.offset = {uniform(engine), uniform(engine), 0.0};
  return x;
}

TEST(PairOnGround, GradientIsTheSlopeOfEachTerm) {
  const InteractionClip clip = test::random_clip(6, 1);
  for (const auto& [name, adapted] :
       {std::pair{PairMode::kGrounded, true}, {PairMode::kGrounded, false}, {PairMode::kBest, true}}) {
    const bool adapt = adapted;  // Clang 14 captures no binding
    PairOptions options = mode(name);
    options.adapt_human = adapt;
    PairProblem problem = make_pair_problem(clip, test::g1(), options);
    EXPECT_EQ(name == PairMode::kBest, problem.nearness.size() > 0 && problem.rest.norm() > 1.0);
    for (SpherePair& pair : problem.spheres.pairs) pair.reach += 0.3;  // so that many are in each other
    const PairVariables x = [&] {
      PairVariables v = random_above_legs(problem, 5);
      if (!adapt) v.frames.middleRows(problem.chain.dof() + 3, 3 * kHumanOffsets).setZero();
      return v;
    }();
    PairVariables gradient;
    const PairTerms terms = evaluate(problem, options, options.weights, x, &gradient);
    EXPECT_GT(terms.collision, 0.01);
    EXPECT_EQ(adapt, terms.bone > 0.01);
    EXPECT_EQ(adapt, terms.partner > 0.01);
    for (const unsigned seed : {11U, 12U, 13U}) {
      PairVariables d = random_above_legs(problem, seed);
      if (!adapt) d.frames.middleRows(problem.chain.dof() + 3, 3 * kHumanOffsets).setZero();
      const auto at = [&](double h) {
        return evaluate(problem, options, options.weights, {x.frames + h * d.frames, x.offset + h * d.offset})
            .total(options.weights);
      };
      const double slope = (at(1e-5) - at(-1e-5)) / 2e-5;
      const double analytic = gradient.frames.cwiseProduct(d.frames).sum() + gradient.offset.dot(d.offset);
      EXPECT_NEAR(analytic, slope, 1e-6 * (1.0 + std::abs(analytic))) << seed;  // the collision term bends at its edge
    }
    EXPECT_EQ(gradient.offset.z(), 0.0);
    EXPECT_EQ(gradient.frames.middleRows(problem.chain.dof(), 3).norm(), 0.0);
  }
}

TEST(PairOnGround, KernelsDescendAsTheReferenceDoes) {
  for (const auto& [name, frames] : {std::pair{PairMode::kGrounded, 5},
                                     {PairMode::kGrounded, 16},
                                     {PairMode::kGrounded, 37},
                                     {PairMode::kGrounded, 250},
                                     {PairMode::kBest, 37},
                                     {PairMode::kBest, 150}}) {
    PairOptions options = mode(name);
    options.optimizer = Optimizer::kAdam;
    options.schedule = {.stage1_iterations = 40, .stage1_rate = 0.05, .stage2_iterations = 20, .stage2_rate = 0.02};
    options.schedule.epsilon = 5.0 / frames;
    PairProblem problem = make_pair_problem(test::random_clip(frames, frames), test::g1(), options);
    for (SpherePair& pair : problem.spheres.pairs) pair.reach += 0.2;
    options.kernel = KernelKind::kScalar;
    const PairSolution reference = solve_pair(problem, options);
    EXPECT_GT(reference.terms.back().collision, 0.0);
    for (const KernelKind kernel : available_kernels()) {
      options.kernel = kernel;
      const PairSolution lanes = solve_pair(problem, options);
      EXPECT_LT((lanes.x.frames - reference.x.frames).cwiseAbs().maxCoeff(), 2e-4) << frames;
      for (std::size_t i = 0; i < lanes.terms.size(); ++i) {
        const PairTerms &a = lanes.terms[i], &b = reference.terms[i];
        EXPECT_NEAR(lanes.total[i], reference.total[i], 1e-5 * reference.total[i]);
        EXPECT_NEAR(a.bone, b.bone, 1e-4 * b.bone + 1e-8);
        EXPECT_NEAR(a.partner, b.partner, 1e-4 * b.partner + 1e-8);
        EXPECT_NEAR(a.collision, b.collision, 1e-4 * b.collision + 1e-8);
      }
    }
  }
}

TEST(PairOnGround, Avx2AndAvx512GiveTheSameBitsInEveryMode) {
  if (!kernel_runs_here(KernelKind::kV4)) GTEST_SKIP() << "not run: AVX-512 absent";
  const InteractionClip clip = test::random_clip(137, 10);
  for (const auto& [name, optimizer] : {std::pair{PairMode::kPaper, Optimizer::kLbfgs},
                                        {PairMode::kGrounded, Optimizer::kAdam},
                                        {PairMode::kBest, Optimizer::kLbfgs}}) {
    PairOptions options = mode(name);
    options.optimizer = optimizer;
    options.kernel = KernelKind::kV3;
    const PairedMotion a = retarget(clip, test::g1(), options);
    options.kernel = KernelKind::kV4;
    const PairedMotion b = retarget(clip, test::g1(), options);
    EXPECT_EQ(a.robot.q, b.robot.q);
    EXPECT_EQ(a.partner.joints, b.partner.joints);
    EXPECT_EQ(a.loss, b.loss);
  }
}

TEST(PairOnGround, DistancesOfThoseWhoAreFarDoNotCount) {
  PairOptions options = mode(PairMode::kBest);
  InteractionClip clip = test::random_clip(20, 7);
  const auto nearness = [&] { return make_pair_problem(clip, test::g1(), options).nearness; };
  EXPECT_GT(nearness().maxCoeff(), 0.9);
  EXPECT_LT(nearness().minCoeff(), 0.5);
  for (int t = 0; t < 20; ++t) clip.a.joints.frame(t).row(0).array() -= 3.0;
  EXPECT_EQ(nearness().maxCoeff(), 0.0);
  options.contact_range = 20.0;
  EXPECT_EQ(nearness().minCoeff(), 1.0);
  options.contact_range = 0.0;
  EXPECT_EQ(nearness().size(), 0);
}

TEST(PairLbfgs, ReachesWhatAdamReachesInAQuarterOfTheEvaluations) {
  for (const PairMode name : {PairMode::kPaper, PairMode::kGrounded}) {
    for (const KernelKind kernel : available_kernels()) {
      PairOptions options = mode(name);
      options.kernel = kernel;
      const PairProblem problem = make_pair_problem(test::random_clip(200, 3), test::g1(), options);
      const double adam = solve_pair(problem, options).total.back();
      options.optimizer = Optimizer::kLbfgs;
      const PairSolution solution = solve_pair(problem, options);
      EXPECT_LE(solution.total.size(), static_cast<std::size_t>(options.lbfgs_iterations) + 1);
      EXPECT_LT(solution.total.back(), 1.02 * adam) << to_string(kernel);
      const auto imitation = static_cast<std::size_t>(imitation_iterations(options));
      EXPECT_EQ(imitation, 8);
      for (std::size_t i = 1; i < solution.total.size(); ++i)  // the weights change once
        if (i != imitation) {
          EXPECT_LE(solution.total[i], solution.total[i - 1]);
        }
    }
  }
}

TEST(PairLbfgs, TheFirstIterationsAreImitationButOfAShortSearch) {
  PairOptions options;
  for (const auto& [iterations, imitation] : {std::pair{5, 0}, {6, 1}, {48, 8}, {80, 8}}) {
    options.lbfgs_iterations = iterations;
    EXPECT_EQ(imitation_iterations(options), imitation);
  }
  options.optimizer = Optimizer::kLbfgs;
  options.lbfgs_iterations = 5;
  const PairProblem problem = make_pair_problem(test::random_clip(40, 3), test::g1(), options);
  const PairSolution solution = solve_pair(problem, options);
  PairWeights last = options.weights;
  last.con *= options.schedule.stage2_contact_scale;
  EXPECT_NEAR(solution.total.front(), solution.terms.front().total(last), 1e-9 * solution.total.front());
}

TEST(PairOnGround, ThreadsDoNotChangeTheBits) {
  const InteractionClip clip = test::random_clip(90, 12);
  for (const PairMode name : {PairMode::kGrounded, PairMode::kBest}) {
    const PairedMotion expected = retarget(clip, test::g1(), mode(name));
    std::array<PairedMotion, 4> found;
    std::vector<std::jthread> threads;
    threads.reserve(found.size());
    for (PairedMotion& motion : found) threads.emplace_back([&] { motion = retarget(clip, test::g1(), mode(name)); });
    threads.clear();
    for (const PairedMotion& motion : found) {
      EXPECT_EQ(motion.robot.q, expected.robot.q);
      EXPECT_EQ(motion.partner.joints, expected.partner.joints);
      EXPECT_EQ(motion.loss, expected.loss);
    }
  }
}

TEST(PairOnGround, SolesStandWhereThePersonsFeetDo) {
  const InteractionClip clip = test::random_clip(150, 4);
  const PairedMotion motion = retarget(clip, test::g1(), mode(PairMode::kGrounded));
  const FootStance stance = find_stance(motion.source_reactor);
  const LegPose legs(test::g1());
  int standing = 0;
  for (int t = 1; t < motion.frames(); ++t) {
    for (int side = 0; side < 2; ++side) {
      if (stance.stands[side][t] == 0 || stance.stands[side][t - 1] == 0) continue;
      const Eigen::Vector3d now = legs.sole_pose(side, motion.robot.root[t], motion.robot.q.col(t)).p;
      const Eigen::Vector3d before = legs.sole_pose(side, motion.robot.root[t - 1], motion.robot.q.col(t - 1)).p;
      EXPECT_LT(std::abs(now.z()), 0.01) << t;
      EXPECT_LT((now - before).norm() * 50.0, 0.01) << t;
      ++standing;
    }
  }
  EXPECT_GT(standing, 100);
}

TEST(PairOnGround, BaseNeverLeansSidewaysAndLimitsHold) {
  for (const char* name : {"g1", "t1"}) {
    const auto robot = load_shared_robot(name);
    const PairedMotion motion = retarget(test::random_clip(80, 5), *robot, mode(PairMode::kBest));
    for (int t = 0; t < motion.frames(); ++t) {
      EXPECT_NEAR((motion.robot.root[t].R * Eigen::Vector3d::UnitY()).z(), 0.0, 1e-12);
      for (int j = 0; j < robot->dof(); ++j) {
        EXPECT_GE(motion.robot.q(j, t), robot->joints[j].lower);
        EXPECT_LE(motion.robot.q(j, t), robot->joints[j].upper);
      }
    }
  }
}

TEST(PairOnGround, PartnersBonesKeepTheirLengthsAndHandsFollowWrists) {
  const PairedMotion motion = retarget(test::random_clip(60, 6), test::g1(), mode(PairMode::kGrounded));
  double moved = 0.0;
  for (int t = 0; t < motion.frames(); ++t) {
    for (int joint = kLeftShoulder; joint <= kRightHand; ++joint) {
      const auto length = [&](const HumanMotion& m) {
        return (m.joints.at(t, joint) - m.joints.at(t, kSmplParents[joint])).norm();
      };
      EXPECT_NEAR(length(motion.partner), length(motion.source_partner), 1e-9) << kSmplNames[joint];
      moved = std::max(moved, (motion.partner.joints.at(t, joint) - motion.source_partner.joints.at(t, joint)).norm());
    }
  }
  EXPECT_GT(moved, 0.01);
}

TEST(PartnerArms, WristOutOfReachIsDrawnIn) {
  const HumanMotion source = test::random_person(3, 50.0, 1, 0.0, 0.0);
  HumanMotion adapted = source;
  adapted.joints.at(1, kLeftWrist) += Eigen::Vector3d(5.0, 0.0, 0.0);
  adapted.joints.at(2, kLeftWrist) = adapted.joints.at(2, kLeftShoulder);
  keep_arm_lengths(source, adapted);
  for (int t = 0; t < 3; ++t) {
    const auto upper = [&](const HumanMotion& m) {
      return (m.joints.at(t, kLeftElbow) - m.joints.at(t, kLeftShoulder)).norm();
    };
    const auto lower = [&](const HumanMotion& m) {
      return (m.joints.at(t, kLeftWrist) - m.joints.at(t, kLeftElbow)).norm();
    };
    EXPECT_NEAR(upper(adapted), upper(source), 1e-9) << t;
    EXPECT_NEAR(lower(adapted), lower(source), 1e-9) << t;
  }
  EXPECT_LT((adapted.joints.frame(0) - source.joints.frame(0)).norm(), 1e-9);
}

TEST(LegPose, FindsThePoseThatMadeTheSoles) {
  const RobotModel& robot = test::g1();
  const LegPose legs(robot);
  const Pose X_WB{yaw_rotation(0.4) * Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()), {1.0, 2.0, 0.72}};
  Eigen::VectorXd truth = robot.neutral;
  truth[0] = -0.6;
  truth[3] = 1.0;
  truth[5] = 0.1;
  for (int side = 0; side < 2; ++side) {
    const Pose X_WS = legs.sole_pose(side, X_WB, truth);
    Eigen::VectorXd q = robot.neutral;
    EXPECT_LT(legs.solve(side, X_WB, X_WS, q), 1e-5);
    EXPECT_LT((legs.sole_pose(side, X_WB, q).p - X_WS.p).norm(), 1e-5);
  }
  const Pose far{yaw_rotation(0.4), {1.0, 2.0, -3.0}};
  EXPECT_LE((X_WB * legs.hip(0) - legs.within_reach(0, X_WB, far) * legs.sole(0)).norm(), 3.0);
  Eigen::VectorXd q = robot.neutral;
  EXPECT_GT(legs.solve(0, X_WB, far, q), 1.0);
  EXPECT_TRUE(q.allFinite());
}

TEST(PairOnGround, RobotsWithoutLegsAreRefusedByName) {
  RobotModel robot = test::g1();
  robot.roles.legs = {};
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [&] { retarget(test::random_clip(10, 1), robot, mode(PairMode::kGrounded)); }));
}

TEST(PairOptionsModes, ModeComesFirstWhereverItStands) {
  const PairOptions options = make_pair_options({{"contact-blocks", "full"}, {"mode", "best"}});
  EXPECT_EQ(options.contact_blocks, ContactBlocks::kFull);
  EXPECT_EQ(options.optimizer, Optimizer::kLbfgs);
  EXPECT_TRUE(options.ground);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] {
    validate(make_pair_options({{"mode", "grounded"}, {"root", "per-frame"}}));
  }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { make_pair_options({{"mode", "floating"}}); }));
}

TEST(PairOnGround, HandsWeighAsAskedUnlessKeypointsAreListed) {
  const InteractionClip clip = test::random_clip(10, 1);
  const auto hand_weights = [&](const std::vector<std::pair<std::string, std::string>>& choices) {
    const PairChain chain = make_pair_problem(clip, test::g1(), make_pair_options(choices)).chain;
    std::vector<double> hands;
    for (int k = 0; k < chain.keys(); ++k) {
      if (chain.key_smpl[k] == kLeftHand || chain.key_smpl[k] == kRightHand)
        hands.push_back(chain.key_weight[k]);
      else
        EXPECT_EQ(chain.key_weight[k], 1.0);
    }
    return hands;
  };
  EXPECT_THAT(hand_weights({{"mode", "paper"}}), testing::ElementsAre(1.0, 1.0));
  EXPECT_THAT(hand_weights({{"mode", "grounded"}}), testing::ElementsAre(3.0, 3.0));
  EXPECT_THAT(hand_weights({{"mode", "best"}}), testing::ElementsAre(5.0, 5.0));
  EXPECT_THAT(hand_weights({{"mode", "best"}, {"w-hand", "2"}}), testing::ElementsAre(2.0, 2.0));
  EXPECT_THAT(hand_weights({{"mode", "paper"}, {"w-hand", "0.5"}}), testing::ElementsAre(0.5, 0.5));
  EXPECT_THAT(hand_weights({{"mode", "best"}, {"keypoint-list", "head,left_hand,right_hand"}}),
              testing::ElementsAre(1.0, 1.0));
  EXPECT_THAT(hand_weights({{"mode", "best"}, {"keypoints", "seven"}}), testing::IsEmpty());
}

// People who walk: the robot's feet stand the longer, the quicker they may step, and never while the person's swings.
TEST(PairOnGround, AQuickerStepTakesLessFromTheStances) {
  SynthesisOptions synthesis;
  synthesis.seed = 777;
  const InteractionClip clip = synthesize(Task::kHandshake, synthesis);
  const FootStance person = find_stance(clip.reactor_motion());
  int before = 0;
  for (const char* speed : {"0.8", "1.2", "1.8"}) {
    const PairOptions options = make_pair_options({{"mode", "best"}, {"step-speed", speed}});
    const FootStance robot = make_pair_problem(clip, test::g1(), options).plan.stance;
    int frames = 0;
    for (int side = 0; side < 2; ++side)
      for (int t = 0; t < clip.frames(); ++t) {
        EXPECT_LE(robot.stands[side][t], person.stands[side][t]) << speed << " " << t;
        frames += robot.stands[side][t];
      }
    EXPECT_GT(frames, before) << speed;
    before = frames;
  }
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] {
    validate(make_pair_options({{"mode", "best"}, {"step-speed", "0"}}));
  }));
}

// A foot that rests, jumps by a camera's noise, steps and rests again.
TEST(FootContact, SeesAStepAndPassesOverNoise) {
  HumanMotion person = test::random_person(200, 50.0, 1, 0.0, 0.0);
  std::mt19937 engine(3);
  std::normal_distribution<double> noise(0.0, 0.01);
  for (int t = 0; t < 200; ++t) {
    const double s = std::clamp((t - 90) / 20.0, 0.0, 1.0);
    for (const int joint : {kLeftAnkle, kLeftToe, kRightAnkle, kRightToe}) {
      const bool left = joint == kLeftAnkle || joint == kLeftToe;
      person.joints.at(t, joint) = Eigen::Vector3d((left ? 0.4 * s : 0.0) + noise(engine), left ? 0.1 : -0.1,
                                                   0.08 + (left ? 0.1 * std::sin(3.14159 * s) : 0.0));
    }
  }
  const FootStance stance = find_stance(person);
  for (int t = 0; t < 200; ++t) EXPECT_TRUE(stance.stands[1][t]) << t;
  EXPECT_TRUE(stance.stands[0][40] && stance.stands[0][160]);
  EXPECT_FALSE(stance.stands[0][100]);
  EXPECT_TRUE(stance.both(20));
}

TEST(BodySpheres, AreInThePersonWhomTheyStandFor) {
  const HumanMotion partner = test::random_clip(20, 3).b;
  UprightChain upright = make_upright_chain(test::g1(), make_chain(test::g1(), ContactKeypoints::kNine));
  const BodySpheres spheres = make_body_spheres(test::g1(), upright, partner);
  const HumanBody body = make_human_body(bone_lengths(partner));
  ASSERT_GT(spheres.human.points(), 10);
  for (int t = 0; t < partner.frames(); t += 5)
    for (int i = 0; i < spheres.human.points(); ++i) {
      double nearest = 1.0;  // to the middle or an end of one of the person's capsules
      for (const HumanCapsule& capsule : body.capsules) {
        const auto [a, b] = capsule.ends(partner.joints.frame(t));
        for (const Eigen::Vector3d& p : {a, b, Eigen::Vector3d(0.5 * (a + b))})
          nearest = std::min(nearest, (spheres.human.at(t, i) - p).norm());
      }
      EXPECT_LT(nearest, 1e-9) << t << " " << i;
    }
}

}  // namespace
}  // namespace duet
