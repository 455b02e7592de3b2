#include "duet/hardware/safety/limiter_setup_json.h"

#include <fmt/format.h>

#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using Json = nlohmann::json;

Json numbers(const Eigen::VectorXd& values) { return std::vector<double>(values.begin(), values.end()); }

Eigen::VectorXd vector_of(const Json& json) {
  const auto values = json.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

Json human_json(const HumanBody& human) {
  Json list = Json::array();
  for (const HumanCapsule& c : human.capsules)
    list.push_back({c.name, c.region, c.joint_a, c.joint_b, c.radius, c.begin, c.end});
  return list;
}

HumanCapsule capsule_of(const Json& c, const std::string& name) {
  HumanCapsule capsule{.name = c.at(0),
                       .region = c.at(1),
                       .joint_a = c.at(2),
                       .joint_b = c.at(3),
                       .radius = c.at(4),
                       .begin = c.at(5),
                       .end = c.at(6)};
  for (const int joint : {capsule.joint_a, capsule.joint_b})
    if (joint < 0 || joint >= kSmplJoints)
      throw InputError(fmt::format("{}: capsule '{}': expected joints 0 to {}, found {}", name, excerpt(capsule.name),
                                   kSmplJoints - 1, joint));
  return capsule;
}

HumanBody human_of(const Json& json, const std::string& name) {
  HumanBody human;
  for (const Json& c : json) human.capsules.push_back(capsule_of(c, name));
  return human;
}

// That of a card that ships here, by its name alone: a log does not say which files are read.
std::shared_ptr<const RobotModel> robot_of(const std::string& robot, const std::string& name) {
  try {
    if (robot.find_first_of("/.") == std::string::npos) return load_shared_robot(robot);
  } catch (const MissingError&) {
  }
  throw InputError(fmt::format("{}: expected the name of a robot that ships, found '{}'", name, excerpt(robot)));
}

Json contact_json(const ContactLimits& limits) {
  Json list = Json::array();
  for (const RegionLimits& r : limits.regions)
    list.push_back({r.region, r.quasi_static_n.value_or(0.0), r.stiffness_n_mm.value_or(0.0), r.mass_kg.value_or(0.0)});
  return {{"name", limits.name}, {"verified_by", limits.verified_by}, {"regions", list}};
}

std::optional<double> positive(const Json& json) {
  const double value = json.get<double>();
  return value > 0.0 ? std::optional(value) : std::nullopt;
}

ContactLimits contact_of(const Json& json) {
  ContactLimits limits{.name = json.at("name"), .source = "", .verified_by = json.at("verified_by"), .regions = {}};
  for (const Json& r : json.at("regions")) {
    RegionLimits& region = limits.regions.emplace_back();
    region.region = r.at(0);
    region.quasi_static_n = positive(r.at(1));
    region.stiffness_n_mm = positive(r.at(2));
    region.mass_kg = positive(r.at(3));
  }
  return limits;
}

LimiterSetup setup_of(const Json& json, const std::string& name) {
  LimiterSetup setup;
  setup.robot = robot_of(json.at("robot").get<std::string>(), name);
  if (setup.robot->digest != json.at("robot_digest").get<std::string>())
    throw InputError(
        fmt::format("{}: made for another robot '{}' than the one whose card is here", name, setup.robot->name));
  for (const Field<HardwareLimits>& limit : hardware_limit_fields())
    if (const std::string wrong = set_field(limit, setup.limits, json.at("limits").at(limit.name)); !wrong.empty())
      throw InputError(fmt::format("{}: limit '{}': expected {}", name, limit.name, wrong));
  setup.executed.joints = json.at("joints").get<std::vector<int>>();
  setup.executed.kp = vector_of(json.at("kp"));
  setup.executed.kd = vector_of(json.at("kd"));
  setup.executed.fixed_gains = json.value("fixed_gains", false);  // older logs knew no others
  setup.dt = json.at("dt");
  setup.person = json.at("person");
  setup.human = human_of(json.at("human"), name);
  setup.contact_limits = contact_of(json.at("contact_limits"));
  for (const Json& touch : json.at("touches")) setup.touches.push_back({touch.at(0), touch.at(1)});
  return setup;
}

}  // namespace

Json limiter_setup_json(const LimiterSetup& setup) {
  Json limits = Json::object(), touches = Json::array();
  for (const Field<HardwareLimits>& limit : hardware_limit_fields()) limits[limit.name] = limit.text(setup.limits);
  for (const TouchPair& touch : setup.touches) touches.push_back({touch.robot, touch.human});
  return {{"robot", setup.robot->name},
          {"robot_digest", setup.robot->digest},
          {"limits", limits},
          {"joints", setup.executed.joints},
          {"kp", numbers(setup.executed.kp)},
          {"kd", numbers(setup.executed.kd)},
          {"fixed_gains", setup.executed.fixed_gains},
          {"dt", setup.dt},
          {"person", setup.person},
          {"human", human_json(setup.human)},
          {"contact_limits", contact_json(setup.contact_limits)},
          {"touches", touches}};
}

LimiterSetup parse_limiter_setup(const Json& json, const std::string& name) {
  try {
    return setup_of(json, name);
  } catch (const Json::out_of_range& error) {  // "[json.exception.out_of_range.403] key 'forward' not found"
    const std::string_view what = error.what();
    throw InputError(fmt::format("{}: the setup of a limiter: {}", name, what.substr(what.find("] ") + 2)));
  } catch (const Json::exception& error) {
    throw InputError(fmt::format("{}: expected the setup of a limiter, found {}", name, error.what()));
  }
}

}  // namespace duet
