// Motions for the detector tests: two agents that do a task more or less well, and transformations of them.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "duet/core/numbers.h"
#include "duet/metrics/detector.h"

namespace duet::test {

inline Eigen::Matrix3Xd still(const Eigen::Vector3d& p, int frames) { return p.replicate(1, frames); }

inline std::vector<Eigen::Matrix3Xd*> tracks_of(Agent& agent) {
  return {&agent.lhand, &agent.rhand, &agent.head, &agent.root, &agent.torso, &agent.lshoulder, &agent.rshoulder};
}

// An agent that stands still at `root`, looking along +x (`facing` 1) or -x (-1), hands hanging.
inline Agent standing(const Eigen::Vector3d& root, double facing, int frames) {
  const auto place = [&](double x, double y, double z) {
    return still(root + Eigen::Vector3d(facing * x, facing * y, z), frames);
  };
  Agent agent;
  agent.root = place(0.0, 0.0, 0.0);
  agent.torso = place(0.0, 0.0, 0.35);
  agent.head = place(0.02, 0.0, 0.65);
  agent.lshoulder = place(0.0, 0.17, 0.45);
  agent.rshoulder = place(0.0, -0.17, 0.45);
  agent.lhand = place(0.1, 0.25, -0.1);
  agent.rhand = place(0.1, -0.25, -0.1);
  return agent;
}

struct Scene {
  Agent performer, partner;
};

// Both do their part of the task, with sizes, distances and noise that vary with the seed so that some succeed and
// some do not. 60 frames.
inline Scene acting(Task task, std::uint64_t seed) {
  constexpr int kFrames = 60;
  Random random(seed, static_cast<std::uint64_t>(task.index()) + 1);
  const double distance = random.uniform(0.35, task == Task::kHug ? 1.6 : 1.1);
  Scene scene{standing({0.0, 0.0, 0.9}, 1.0, kFrames), standing({distance, 0.05, 0.85}, -1.0, kFrames)};
  const Eigen::Vector3d middle(0.5 * distance, 0.0, random.uniform(1.0, 1.4));
  const double reach = random.uniform(task == Task::kHandshake || task == Task::kHighFive ? 0.55 : 0.3, 1.1);
  const double blow = random.uniform(-0.1, 0.5);  // how far a kiss is sent [m]
  const double swing = task == Task::kWave ? random.uniform(0.05, 0.35) : 0.0;
  const double lean = task == Task::kBend ? random.uniform(-0.3, 0.5) : 0.0;
  for (int t = 0; t < kFrames; ++t) {
    const double bump = reach * std::pow(std::sin(std::numbers::pi * (t + 0.5) / kFrames), 2);
    const Eigen::Vector3d around(0.0, swing * std::sin(0.7 * t), swing * std::cos(0.9 * t));
    const auto move = [&](Eigen::Matrix3Xd& hand, const Eigen::Vector3d& target) {
      hand.col(t) += bump * (target - hand.col(t)) + around;
    };
    if (task == Task::kHug) move(scene.performer.lhand, scene.partner.torso.col(t));
    if (task == Task::kHug) move(scene.performer.rhand, scene.partner.torso.col(t));
    if (task == Task::kHandshake || task == Task::kHighFive) move(scene.partner.rhand, middle);
    if (task == Task::kHandshake || task == Task::kHighFive) move(scene.performer.rhand, middle);
    if (task == Task::kWave) move(scene.performer.rhand, Eigen::Vector3d(0.2, -0.4, 1.5));
    if (task == Task::kFlyKiss) {
      const double sent = std::max(0.0, 2.0 * t / kFrames - 1.0);
      move(scene.performer.rhand, scene.performer.head.col(t));
      scene.performer.rhand(0, t) += blow * sent;
    }
    scene.performer.head.col(t) += bump * Eigen::Vector3d(lean, 0.0, -0.3 * std::abs(lean));
  }
  for (Agent* agent : {&scene.performer, &scene.partner})
    for (Eigen::Matrix3Xd* track : tracks_of(*agent))
      for (double& x : track->reshaped()) x += 0.003 * random.normal();
  return scene;
}

inline Agent transformed(Agent agent, const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map) {
  for (Eigen::Matrix3Xd* track : tracks_of(agent))
    for (Eigen::Index t = 0; t < track->cols(); ++t) track->col(t) = map(track->col(t)).eval();
  return agent;
}

// Mirror image in the plane y = 0 with left and right exchanged.
inline Agent mirrored(Agent agent) {
  agent = transformed(agent, [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.x(), -p.y(), p.z()); });
  std::swap(agent.lhand, agent.rhand);
  std::swap(agent.lshoulder, agent.rshoulder);
  return agent;
}

inline Agent reversed(Agent agent) {
  for (Eigen::Matrix3Xd* track : tracks_of(agent)) *track = track->rowwise().reverse().eval();
  return agent;
}

}  // namespace duet::test
