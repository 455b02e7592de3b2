// An engine is a shared object beside the program, duet_<name>.so, loaded when it is first asked for: a machine that
// lacks one engine's library still runs the others, and a new engine needs no change to duet. docs/extending.md.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/core/field.h"
#include "duet/core/share.h"

namespace duet {

// Where an engine is known to miss a tolerance of the conformance suite: an entry of its module, with its reason and
// with a bound that still holds. An entry that no longer deviates is as wrong as a missing one
// (conformance::stale_deviations).
struct EngineDeviation {
  std::string_view scene;
  std::string_view quantity;  // or how several of them begin
  std::string_view reason;
  double bound = 0.0;                // error_of() stays at or below, on the robot that stands in
  bool only_at_full_effort = false;  // only the smaller or larger steps of full effort show it
};

// A setting that an engine's module offers, declared once: a field (core/field.h) of the options by name, which says
// the default of one that is not there. `duet list`, profiles and error messages are made from it.
using EngineOption = Field<EngineOptions>;

EngineOption number_option(std::string name, double value, double low, double high, std::string meaning);
EngineOption integer_option(std::string name, int value, int low, int high, std::string meaning);
EngineOption choice_option(std::string name, std::vector<std::string> choices, std::string meaning);  // first: default

// Throws std::invalid_argument: an unknown name (with the nearest), a value out of range or not a choice; `engine` is
// named.
void check_options(std::string_view engine, const EngineOptions& options, std::span<const EngineOption> known);

// The value that holds, set or default. std::logic_error for a name that is not in `known`.
double option_number(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name);
int option_integer(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name);
std::string option_choice(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name);

// A number that duet and a module of an engine share only where both lay out alike what passes between them: sizes and
// places of the members of those types, how many virtual functions Backend has, and what the compiler was told of the
// standard library and of Eigen. Each side computes its own; nobody has to remember to raise a number.

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

inline std::uint64_t engine_interface();

struct EngineModule {
  // Both are set by themselves; a module whose interface is not the program's is refused, and what stands behind these
  // two members is then not looked at.
  std::uint64_t interface = engine_interface();
  const char* built_with = duet_version();
  const char* name = "";
  std::string (*version)() = nullptr;  // the engine's own
  // Throws std::invalid_argument (scene, options) and std::runtime_error with the engine's message where it refuses.
  std::unique_ptr<Backend> (*make)(const Scene& scene) = nullptr;
  std::span<const EngineOption> options;  // what a profile may set
  // The cost of the engine itself, against which the overhead of Backend::step is measured: CPU seconds for `steps`
  // steps from `state` under `command`, by the least code that makes the same engine calls under the same torque law
  // and reads the state back. Throws std::invalid_argument for steps < 1.
  double (*bare_step_seconds)(const Scene& scene, const RobotState& state, const JointCommand& command,
                              int steps) = nullptr;
  // At most so long a step of the G1 standing on its feet is to take, under `duet bench` [us]; 0: nothing is asked.
  double step_target_us = 0.0;
  std::span<const EngineDeviation> deviations = {};
  // Why the engine takes no PartnerMode::kSolid, part of a sentence ("nothing touches its robot"); "" where it does.
  // make_backend refuses such a scene, and the conformance suite lists what needs it as unsupported.
  const char* no_solid_partner = "";
  // Why this machine cannot run the engine though its module loads (packages that are missing), as a sentence without
  // a point; "" where it can. Null: it always can. Asked once.
  std::string (*absence)() = nullptr;
};

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
  digest.add_type(&Scene::robot, &Scene::human, &Scene::partner, &Scene::friction, &Scene::dt, &Scene::law,
                  &Scene::gravity, &Scene::self_collision, &Scene::options);
  digest.add_type(&RobotState::X_WB, &RobotState::v_WB, &RobotState::w_WB_B, &RobotState::q, &RobotState::v);
  digest.add_type(&Reference::X_WB, &Reference::q);
  digest.add_type(&JointCommand::q_target, &JointCommand::kp, &JointCommand::kd, &JointCommand::tau_ff);
  digest.add_type(&Contact::link, &Contact::side, &Contact::other, &Contact::p_WC, &Contact::f_W, &Contact::depth);
  digest.add_type(&Snapshot::values);
  digest.add_type(&FieldDoc::name, &FieldDoc::meaning, &FieldDoc::unit, &FieldDoc::range, &FieldDoc::choices);
  digest.add_type(&EngineOption::values, &EngineOption::text, &EngineOption::assign);
  digest.add_type(&EngineDeviation::scene, &EngineDeviation::quantity, &EngineDeviation::reason,
                  &EngineDeviation::bound, &EngineDeviation::only_at_full_effort);
  digest.add_type(&EngineModule::interface, &EngineModule::built_with, &EngineModule::name, &EngineModule::version,
                  &EngineModule::make, &EngineModule::options, &EngineModule::bare_step_seconds,
                  &EngineModule::step_target_us, &EngineModule::deviations, &EngineModule::no_solid_partner,
                  &EngineModule::absence);
  digest.add_type<Backend>();
  digest.add(engine_layout::Digest::first_word(&engine_layout::AfterBackend::after));
  return digest.value();
}

}  // namespace duet

// The one symbol that a module exports. DUET_ENGINE_MODULE(module) defines it.
extern "C" const duet::EngineModule* duet_engine_module();

#define DUET_ENGINE_MODULE(module) \
  extern "C" __attribute__((visibility("default"))) const duet::EngineModule* duet_engine_module() { return &(module); }

namespace duet {

// Engines by name: the modules duet_<engine>.so that are found (backends/engine_module.h) in the folders $DUET_ENGINES
// ("mine:/usr/lib/duet/engines") if it is set, else in the first of these that is there: `engines` beside the program,
// lib/duet/engines of an installed duet (core/share.h), where it was built. Missing engines are listed with their
// reason and refused by name (MissingError). Thread-safe; a module is loaded once and stays.

struct EngineInfo {
  std::string name;
  bool available = false;
  std::string version;  // where available
  std::string reason;   // why not, where not ("libode.so.8: cannot open shared object file")
  const EngineModule* module =
      nullptr;  // null where none could be loaded; its tables hold where `absence` says why not
};

// The five engines of the benchmark whether present or not, then other modules by name.
std::vector<EngineInfo> engines();

// Throws std::invalid_argument for an unknown name (with the nearest), options that the engine does not have and a
// scene that it refuses; MissingError for an engine that this machine lacks, and for a solid partner in one that has
// none.
std::unique_ptr<Backend> make_backend(const std::string& engine, const Scene& scene);

// Throws as make_backend.
const EngineModule& engine_module(const std::string& engine);
// Why the engine cannot take scenes with a partner of this mode, one sentence; "" where it can, and for an engine that
// is not there.
std::string refusal_of(const std::string& engine, PartnerMode partner);
// Null where there is none of that name, or where this machine lacks it.
const EngineModule* find_engine_module(const std::string& engine);

}  // namespace duet
