// Episodes whose right answer is known before the rule `interaction` sees them: for each task twenty that are the
// interaction, by people of either generator, and twenty that are not, each wrong in one way that its name says.
// Nothing was chosen on them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "duet/metrics/interaction.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr int kRight = 20, kWrong = 20;
constexpr std::uint64_t kSeed = 771;  // of no suite

struct Made {
  std::string kind;
  InteractionEvidence evidence;
};

Agent agent_of(const HumanMotion& motion) { return human_agent(motion.joints); }

Agent part_of(Agent agent, int begin, int end) {
  for (Eigen::Matrix3Xd* track : test::tracks_of(agent)) *track = track->middleCols(begin, end - begin).eval();
  return agent;
}

bool touches(Task task) { return definition_of(task).interaction.touch != Touch::kNone; }

// The clip with its reactor as the performer; every second partner is solid, where bodies meet.
InteractionEvidence right_one(Task task, int i) {
  SynthesisOptions options{.seed = kSeed, .index = i};
  if (i % 2 == 1) {
    options.like = Likeness::kPeople;
    options.before = 2.0;
    options.after = 2.0;
    options.outcome = ActOutcome::kComplete;
  }
  const InteractionClip clip = synthesize(task, options);
  InteractionEvidence e{.performer = agent_of(clip.reactor_motion()), .partner = agent_of(clip.actor_motion())};
  e.window = {clip.phases.act_begin - 25, clip.phases.act_end + 50};
  e.model = part_of(e.performer, clip.phases.act_begin, clip.phases.act_end);
  e.model_begin = clip.phases.act_begin;
  if (touches(task) && i % 4 >= 2) e.touch = PartnerTouch{.hands_s = 0.8, .trunk_s = 1.2, .settled_ratio = 0.6};
  return e;
}

// The performer as it was `frames` earlier; at the begin and at the end it stands as it does there.
void delay(Agent& agent, int frames) {
  for (Eigen::Matrix3Xd* track : test::tracks_of(agent)) {
    const Eigen::Matrix3Xd before = *track;
    for (Eigen::Index t = 0; t < before.cols(); ++t)
      track->col(t) = before.col(std::clamp<Eigen::Index>(t - frames, 0, before.cols() - 1));
  }
}

void stand_still(InteractionEvidence& e) { delay(e.performer, static_cast<int>(e.performer.root.cols())); }

// The right hand raised to the shoulders' height in the frames [begin, end), with 0.3 s of way to either side.
void raise_hand(Agent& agent, int begin, int end) {
  for (int t = std::max(begin - 15, 0); t < std::min<int>(end + 15, static_cast<int>(agent.root.cols())); ++t) {
    const double share = std::clamp(std::min(t - begin + 15, end + 15 - t) / 15.0, 0.0, 1.0);
    Eigen::Vector3d up = agent.rshoulder.col(t);
    up.head<2>() += 0.3 * (agent.torso.col(t) - agent.root.col(t)).head<2>() + Eigen::Vector2d(0.05, 0.0);
    agent.rhand.col(t) += share * (up - agent.rhand.col(t));
  }
}

// The performer walks on through the partner while the act lasts, and back.
void walk_through(InteractionEvidence& e) {
  const int begin = e.window.begin + 25, end = e.window.end - 50;
  for (int t = std::max(begin, 0); t < std::min<int>(end, static_cast<int>(e.performer.root.cols())); ++t) {
    const double share = std::clamp(std::min(t - begin, end - t) / 15.0, 0.0, 1.0);
    const Eigen::Vector2d to = (e.partner.root.col(t) - e.performer.root.col(t)).head<2>();
    for (Eigen::Matrix3Xd* track : test::tracks_of(e.performer)) track->col(t).head<2>() += share * to;
  }
}

void move_aside(Agent& agent, const Agent& partner, double metres) {
  for (Eigen::Index t = 0; t < agent.root.cols(); ++t) {
    Eigen::Vector2d away = (agent.root.col(t) - partner.root.col(t)).head<2>();
    if (away.norm() > 0.0) away.normalize();
    for (Eigen::Matrix3Xd* track : test::tracks_of(agent)) track->col(t).head<2>() += metres * away;
  }
}

// Scales how far head, hands and shoulders are off the vertical over the root, as if the bow were so much of one.
void lean_less(Agent& agent, double share) {
  const Eigen::Vector3d upright = agent.head.col(0) - agent.root.col(0);
  for (Eigen::Index t = 0; t < agent.head.cols(); ++t) {
    const Eigen::Vector3d lean = agent.head.col(t) - agent.root.col(t);
    agent.head.col(t) = agent.root.col(t) + upright + share * (lean - upright);
  }
}

// The hand stays where it was when it came up, and never swings, goes out or meets anything.
void freeze_hands_when_up(Agent& agent) {
  for (Eigen::Matrix3Xd* hand : {&agent.lhand, &agent.rhand}) {
    Eigen::Vector3d held = Eigen::Vector3d::Zero();
    bool up = false;
    for (Eigen::Index t = 0; t < hand->cols(); ++t) {
      const Eigen::Vector3d over = hand->col(t) - agent.root.col(t);
      if (!up && over.z() > 0.35) {
        held = over;
        up = true;
      }
      if (up) hand->col(t) = agent.root.col(t) + held;
    }
  }
}

void other_task(InteractionEvidence& e, Task task, int i) {
  const Task other = task == Task::kWave ? Task::kBend : Task::kWave;
  InteractionEvidence made = right_one(other, i);
  const auto frames = static_cast<int>(e.performer.root.cols());
  Agent performer = made.performer;
  for (Eigen::Matrix3Xd* track : test::tracks_of(performer)) {
    const Eigen::Matrix3Xd before = *track;
    track->resize(3, frames);
    for (int t = 0; t < frames; ++t) track->col(t) = before.col(std::min<Eigen::Index>(t, before.cols() - 1));
  }
  e.performer = performer;
}

using Spoil = std::function<void(InteractionEvidence& e, int i)>;
struct Wrong {
  std::string kind;
  Spoil spoil;
};

std::vector<Wrong> wrong_ones(Task task) {
  std::vector<Wrong> all = {
      {"late", [](auto& e, int) { delay(e.performer, e.window.end - e.window.begin + 100); }},
      {"stands still", [](auto& e, int) { stand_still(e); }},
      {"fell", [](auto& e, int) { e.stands = false; }},
      {"another task", [task](auto& e, int i) { other_task(e, task, i); }},
  };
  const auto false_start = [](auto& e, int) {
    const int begin = std::max(e.window.begin - 75, 10);
    raise_hand(e.performer, begin, begin + 30);
  };
  if (task != Task::kHug && task != Task::kBend) all.push_back({"false start", false_start});
  if (touches(task)) {
    all.push_back({"too hard", [](auto& e, int) { e.touch = PartnerTouch{0.8, 1.2, 1.3}; }});
    all.push_back({"touched nothing", [](auto& e, int) { e.touch = PartnerTouch{0.0, 0.0, 0.0}; }});
    all.push_back({"too far by a body", [](auto& e, int) {
                     e.touch.reset();
                     move_aside(e.performer, e.partner, 0.45);
                   }});
    all.push_back({"through the body", [](auto& e, int) {
                     e.touch.reset();
                     walk_through(e);
                   }});
    all.push_back({"hands held still", [](auto& e, int) {
                     stand_still(e);
                     raise_hand(e.performer, 60, 90);
                   }});
  }
  if (touches(task) && task != Task::kHug)
    all.push_back({"near miss by 5 cm", [](auto& e, int) {
                     e.touch.reset();
                     move_aside(e.performer, e.partner, 0.17);
                   }});
  if (task == Task::kBend) all.push_back({"half a bow", [](auto& e, int) { lean_less(e.performer, 0.45); }});
  if (task == Task::kWave || task == Task::kFlyKiss)
    all.push_back({"raised and held", [](auto& e, int) { freeze_hands_when_up(e.performer); }});
  return all;
}

int judged(const std::vector<Made>& made, bool expected, Task task, std::string& wrong) {
  int right = 0;
  for (std::size_t i = 0; i < made.size(); ++i) {
    const DetectorResult result = judge_interaction(task, made[i].evidence);
    if (result.success == expected) {
      ++right;
      continue;
    }
    wrong += fmt::format("\n  {} {} '{}':", to_string(task), i, made[i].kind);
    for (const auto& [part, holds] : result.parts)
      if (!holds) wrong += " " + part;
    for (const auto& [name, value] : result.values) wrong += fmt::format(" {} {:.3g}", name, value);
  }
  return right;
}

class MadeEpisodes : public testing::TestWithParam<Task> {};

TEST_P(MadeEpisodes, AreJudgedAsTheyWereMade) {
  const Task task = GetParam();
  std::vector<Made> right, wrong;
  for (int i = 0; i < kRight; ++i) right.push_back({"right", right_one(task, i)});
  const std::vector<Wrong> kinds = wrong_ones(task);
  for (int i = 0; i < kWrong; ++i) {
    const Wrong& kind = kinds[static_cast<std::size_t>(i) % kinds.size()];
    Made made{kind.kind, right_one(task, kRight + i)};
    kind.spoil(made.evidence, i);
    wrong.push_back(std::move(made));
  }
  std::string misjudged;
  EXPECT_GE(judged(right, true, task, misjudged), 19) << misjudged;
  EXPECT_GE(judged(wrong, false, task, misjudged), 19) << misjudged;
}

INSTANTIATE_TEST_SUITE_P(Tasks, MadeEpisodes,
                         testing::Values(Task::kHug, Task::kHandshake, Task::kHighFive, Task::kWave, Task::kBend,
                                         Task::kFlyKiss, parse_task("fist_bump")),
                         [](const auto& info) { return std::string(to_string(info.param)); });

}  // namespace
}  // namespace duet
