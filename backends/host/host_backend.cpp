#include "duet/backends/host/host_backend.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "duet/backends/narrow_phase.h"
#include "duet/backends/physics_backend.h"

namespace duet {
namespace {

using nlohmann::json;

constexpr double kUnitTolerance = 1e-6;

json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
json quat_wxyz(const Eigen::Quaterniond& R) { return {R.w(), R.x(), R.y(), R.z()}; }

json links_of(const RobotModel& robot) {
  json links = json::array();
  for (const RobotLink& link : robot.links) {
    const Eigen::Matrix3d& I = link.inertia;
    links.push_back({{"name", link.name},
                     {"parent", link.parent},
                     {"p", numbers(link.X_PL.p)},
                     {"quat_wxyz", quat_wxyz(link.X_PL.R)},
                     {"axis", numbers(link.axis)},
                     {"mass", link.mass},
                     {"com", numbers(link.com)},
                     {"inertia", {I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)}}});
  }
  return links;
}

json robot_of(const RobotModel& robot) {
  json joints = json::array(), shapes = json::array(), pairs = json::array();
  for (const RobotJoint& joint : robot.joints)
    joints.push_back({{"name", joint.name},
                      {"lower", joint.lower},
                      {"upper", joint.upper},
                      {"effort", joint.effort},
                      {"armature", joint.armature}});
  for (const RobotShape& shape : robot.shapes)
    shapes.push_back({{"kind", shape.kind == ShapeKind::kSphere ? "sphere" : "capsule"},
                      {"link", shape.link},
                      {"p", numbers(shape.X_LS.p)},
                      {"quat_wxyz", quat_wxyz(shape.X_LS.R)},
                      {"radius", shape.radius},
                      {"half_length", shape.half_length}});
  for (const auto& [first, second] : robot.self_collision) pairs.push_back({first, second});
  return {{"name", robot.name},
          {"links", links_of(robot)},
          {"joints", std::move(joints)},
          {"shapes", std::move(shapes)},
          {"self_collision", std::move(pairs)}};
}

std::string_view mode_of(PartnerMode mode) {
  return mode == PartnerMode::kNone ? "none" : mode == PartnerMode::kGhost ? "ghost" : "solid";
}

// Writes numbers one behind the other.
struct Writer {
  double* to;
  void add(double value) { *to++ = value; }
  template <typename Vector>
  void add_all(const Vector& vector) {
    to = std::copy_n(vector.data(), vector.size(), to);
  }
  void add_rotation(const Eigen::Quaterniond& R) {
    for (const double value : {R.w(), R.x(), R.y(), R.z()}) add(value);
  }
  void add_state(const RobotState& state) {
    add_all(state.X_WB.p);
    add_rotation(state.X_WB.R);
    add_all(state.v_WB);
    add_all(state.w_WB_B);
    add_all(state.q);
    add_all(state.v);
  }
};

// Reads numbers one behind the other, into values that have their sizes.
struct Reader {
  const double* from;
  double next() { return *from++; }
  Eigen::Vector3d next_vector() {
    from += 3;
    return Eigen::Vector3d(from - 3);
  }
  template <typename Vector>
  void read_all(Vector& vector) {
    std::copy_n(from, vector.size(), vector.data());
    from += vector.size();
  }
};

class HostBackend final : public PhysicsBackend {
 public:
  HostBackend(const Scene& scene, const HostProgram& program, std::span<const EngineOption> options)
      : PhysicsBackend(scene),
        host_(take_host(program)),
        facts_(host_->open(host_scene(this->scene(), options))),
        layout_(this->scene(), facts_),
        request_(layout_.request),
        memory_(layout_.memory) {
    contacts_.reserve(layout_.contacts);
  }
  ~HostBackend() override { give_back(std::move(host_)); }
  HostBackend(const HostBackend&) = delete;
  HostBackend& operator=(const HostBackend&) = delete;

  [[nodiscard]] std::string_view name() const override { return host_->program().engine; }
  [[nodiscard]] std::string version() const override { return facts_.version; }

 private:
  void place() override { memory_.assign(memory_.size(), 0.0); }
  void do_kick(const Eigen::Vector3d&) override {}  // the next request has the velocity
  void append_to(std::vector<double>& values) const override {
    values.insert(values.end(), memory_.begin(), memory_.end());
  }
  void read_from(std::span<const double> values) override { memory_.assign(values.begin(), values.end()); }

  Outcome advance(const JointCommand& command) override {
    write(command);
    const std::size_t least = layout_.answer, most = least + HostLayout::kContact * layout_.contacts;
    const std::span<const double> answer = host_->step(request_, least, most);
    for (std::size_t i = 0; i < answer.size(); ++i)
      if (!std::isfinite(answer[i]))
        host_->refuse(fmt::format("number {} of its host's answer at {:.4f} s is not finite", i, time()));
    return read(answer);
  }

  void write(const JointCommand& command) {
    Writer out{request_.data()};
    out.add_state(state_);
    for (const Eigen::VectorXd* part : {&command.q_target, &command.kp, &command.kd, &command.tau_ff})
      out.add_all(*part);
    for (const ExternalForces::Push& push : pushes_.all()) {
      out.add_all(push.f_W);
      out.add_all(push.p_L);
    }
    out.add(partner_.present ? 1.0 : 0.0);
    for (int i = 0; i < layout_.capsules; ++i) write_capsule(scene().human.capsules[i], out);
    out.add_all(memory_);
  }

  void write_capsule(const HumanCapsule& capsule, Writer& out) const {
    const CapsulePose pose = capsule_pose(capsule, partner_.joints);
    out.add_all(pose.X_WC.p);
    out.add_rotation(pose.X_WC.R);
    out.add(pose.half_length);
    for (const Eigen::Vector3d& velocity : capsule.ends(partner_.velocities)) out.add_all(velocity);
  }

  Outcome read(std::span<const double> answer) {
    Reader in{answer.data()};
    const double outcome = in.next();
    if (outcome != 0.0 && outcome != 1.0)
      host_->refuse(fmt::format("its host's answer has the outcome {}, expected 0 or 1 (diverged)", outcome));
    if (outcome == 1.0) return Outcome::kDiverged;
    read_state(in);
    in.read_all(torques_);
    in.read_all(memory_);
    const double count = in.next();
    const std::size_t expected = layout_.answer + HostLayout::kContact * static_cast<std::size_t>(std::max(count, 0.0));
    if (count < 0.0 || count != std::floor(count) || expected != answer.size())
      host_->refuse(fmt::format("its host's answer says {} contacts and has {} numbers", count, answer.size()));
    contacts_.clear();
    for (int i = 0; i < static_cast<int>(count); ++i) contacts_.push_back(read_contact(in));
    return speeds_are_sane(state_) ? Outcome::kOk : Outcome::kDiverged;
  }

  void read_state(Reader& in) {
    in.read_all(state_.X_WB.p);
    const double w = in.next();
    state_.X_WB.R = Eigen::Quaterniond(w, in.from[0], in.from[1], in.from[2]);
    in.from += 3;
    if (std::abs(state_.X_WB.R.norm() - 1.0) > kUnitTolerance)
      host_->refuse(
          fmt::format("the base's quaternion in its host's answer has norm {}, expected 1", state_.X_WB.R.norm()));
    in.read_all(state_.v_WB);
    in.read_all(state_.w_WB_B);
    in.read_all(state_.q);
    in.read_all(state_.v);
  }

  Contact read_contact(Reader& in) {
    const int link = index(in.next(), layout_.links, "link");
    const auto side = static_cast<ContactSide>(index(in.next(), 3, "side"));
    const int others = side == ContactSide::kHuman ? layout_.capsules : layout_.links;
    const double other = in.next();
    Contact contact{.link = link, .side = side};
    contact.other = side == ContactSide::kGround ? -1 : index(other, others, "other side");
    contact.p_WC = in.next_vector();
    contact.f_W = in.next_vector();
    contact.depth = std::max(in.next(), 0.0);
    return contact;
  }

  int index(double value, int count, const char* what) {
    if (value < 0.0 || value >= count || value != std::floor(value))
      host_->refuse(fmt::format("the {} of a contact in its host's answer is {}, expected a whole number from 0 to {}",
                                what, value, count - 1));
    return static_cast<int>(value);
  }

  std::unique_ptr<HostProcess> host_;
  HostFacts facts_;
  HostLayout layout_;
  std::vector<double> request_, memory_;
};

}  // namespace

json host_scene(const Scene& scene, std::span<const EngineOption> options) {
  json settings = json::object(), capsules = json::array();
  for (const EngineOption& option : options) {
    json& value = settings[option.name];
    if (option.choices.empty())
      value = option_number(scene.options, options, option.name);
    else
      value = option_choice(scene.options, options, option.name);
  }
  if (scene.partner == PartnerMode::kSolid)
    for (const HumanCapsule& capsule : scene.human.capsules)
      capsules.push_back(
          {{"radius", capsule.radius}, {"stiffness", capsule.skin.stiffness}, {"damping", capsule.skin.damping}});
  return {{"dt", scene.dt},
          {"gravity", numbers(scene.gravity)},
          {"self_collision", scene.self_collision},
          {"partner", mode_of(scene.partner)},
          {"friction",
           {{"robot_ground", scene.friction.robot_ground},
            {"robot_human", scene.friction.robot_human},
            {"robot_robot", scene.friction.robot_robot}}},
          {"options", std::move(settings)},
          {"robot", robot_of(*scene.robot)},
          {"capsules", std::move(capsules)}};
}

HostLayout::HostLayout(const Scene& scene, const HostFacts& facts)
    : joints(scene.robot->dof()),
      links(static_cast<int>(scene.robot->links.size())),
      capsules(scene.partner == PartnerMode::kSolid ? static_cast<int>(scene.human.capsules.size()) : 0),
      memory(facts.memory),
      contacts(facts.contacts),
      state(13 + 2 * joints),
      request(state + 4 * joints + kPush * links + 1 + kCapsule * capsules + memory),
      answer(1 + state + joints + memory + 1) {}

std::unique_ptr<Backend> make_host_backend(const Scene& scene, const HostProgram& program,
                                           std::span<const EngineOption> options) {
  return std::make_unique<HostBackend>(scene, program, options);
}

}  // namespace duet
