// A number that duet and a module of an engine share only where both lay out alike what passes between them: sizes and
// places of the members of those types, how many virtual functions Backend has, and what the compiler was told of the
// standard library and of Eigen. Each side computes its own; nobody has to remember to raise a number.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/engine_deviation.h"
#include "duet/backends/engine_options.h"

namespace duet {
namespace engine_layout {

// FNV-1a over numbers.
class Digest {
 public:
  void add(std::uint64_t number) {
    for (int byte = 0; byte < 8; ++byte) value_ = (value_ ^ ((number >> (8 * byte)) & 0xff)) * 0x100000001b3u;
  }
  // Size and alignment of T; place and size of each of these members of it.
  template <typename T, typename... Members>
  void add_type(Members T::*... members) {
    add(sizeof(T));
    add(alignof(T));
    (add_member(members), ...);
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  template <typename T, typename Member>
  void add_member(Member T::*member) {
    add(first_word(member));
    add(sizeof(Member));
  }

 public:
  // The first word of a pointer to a member: its offset, or a virtual function's place in the table (Itanium C++ ABI).
  template <typename Pointer>
  static std::uint64_t first_word(Pointer pointer) {
    std::uint64_t word = 0;
    static_assert(sizeof(Pointer) >= sizeof word);
    std::memcpy(&word, &pointer, sizeof word);
    return word;
  }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

// Its one function stands behind all virtual functions of Backend. Never made.
struct AfterBackend : Backend {
  virtual void after() = 0;
};

}  // namespace engine_layout

inline std::uint64_t engine_interface() {
  engine_layout::Digest digest;
  digest.add_type<std::string>();
  digest.add_type<std::vector<double>>();
  digest.add_type<std::map<std::string, std::string>>();
  digest.add_type<std::shared_ptr<int>>();
  digest.add_type<Eigen::VectorXd>();
  digest.add_type<Eigen::Quaterniond>();
  digest.add(EIGEN_WORLD_VERSION * 10000 + EIGEN_MAJOR_VERSION * 100 + EIGEN_MINOR_VERSION);
  digest.add_type(&Pose::R, &Pose::p);
  digest.add_type(&RobotLink::name, &RobotLink::parent, &RobotLink::X_PL, &RobotLink::axis, &RobotLink::mass,
                  &RobotLink::com, &RobotLink::inertia);
  digest.add_type(&RobotJoint::name, &RobotJoint::lower, &RobotJoint::upper, &RobotJoint::effort, &RobotJoint::velocity,
                  &RobotJoint::armature, &RobotJoint::kp, &RobotJoint::kd);
  digest.add_type(&RobotFrame::name, &RobotFrame::link, &RobotFrame::X_LF);
  digest.add_type(&RobotShape::kind, &RobotShape::link, &RobotShape::X_LS, &RobotShape::radius,
                  &RobotShape::half_length, &RobotShape::region);
  digest.add_type(&RobotModel::name, &RobotModel::links, &RobotModel::joints, &RobotModel::frames, &RobotModel::shapes,
                  &RobotModel::self_collision, &RobotModel::feet, &RobotModel::neutral, &RobotModel::standing_height,
                  &RobotModel::digest);
  digest.add_type<HumanBody>();
  digest.add_type(&Scene::robot, &Scene::human, &Scene::partner, &Scene::friction, &Scene::dt, &Scene::gravity,
                  &Scene::self_collision, &Scene::options);
  digest.add_type(&RobotState::X_WB, &RobotState::v_WB, &RobotState::w_WB_B, &RobotState::q, &RobotState::v);
  digest.add_type(&Reference::X_WB, &Reference::q);
  digest.add_type(&JointCommand::q_target, &JointCommand::kp, &JointCommand::kd, &JointCommand::tau_ff);
  digest.add_type(&Contact::link, &Contact::side, &Contact::other, &Contact::p_WC, &Contact::f_W, &Contact::depth);
  digest.add_type(&Snapshot::values);
  digest.add_type(&EngineOption::name, &EngineOption::value, &EngineOption::choices, &EngineOption::low,
                  &EngineOption::high, &EngineOption::whole, &EngineOption::meaning);
  digest.add_type(&EngineDeviation::scene, &EngineDeviation::quantity, &EngineDeviation::reason,
                  &EngineDeviation::bound, &EngineDeviation::only_at_full_effort);
  digest.add_type<Backend>();
  digest.add(engine_layout::Digest::first_word(&engine_layout::AfterBackend::after));
  return digest.value();
}

}  // namespace duet
