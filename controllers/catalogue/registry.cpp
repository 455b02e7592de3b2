#include "duet/controllers/catalogue/registry.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <sstream>
#include <utility>

#include "duet/controllers/composed_network.h"
#include "duet/controllers/controller.h"
#include "duet/controllers/descriptor_controller.h"
#include "duet/controllers/vmc.h"
#include "duet/controllers/wbc_sim/wbc_sim.h"
#include "duet/core/field.h"
#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/nn/catalogue/load_network.h"

namespace duet {
namespace {

using Robot = std::shared_ptr<const RobotModel>;

// Options of every controller beside its own.
struct CommonOptions {
  double explicit_step = 0.0;  // 0: as the controller has it
  bool reference_arms = false;
};

const FieldTable<CommonOptions>& common_table() {
  static const FieldTable<CommonOptions> table = {
      field<CommonOptions>({.name = "explicit_step",
                            .meaning = "physics step [s] at which an explicit PD law without rotor inertia has to "
                                       "hold: lowers kd of the joints that would shake there (0: none)",
                            .range = {0.0, 0.02}},
                           &CommonOptions::explicit_step),
      field<CommonOptions>({.name = "arms",
                            .meaning = "reference: the arms follow the reference whatever the controller answers for "
                                       "them, as where something else moves them",
                            .choices = {"own", "reference"}},
                           &CommonOptions::reference_arms)};
  return table;
}

// Those of `options` that are the controller's own, or those that are not.
ControllerOptions part_of(const ControllerOptions& options, bool own) {
  ControllerOptions part;
  for (const auto& [name, value] : options)
    if ((find_field(common_table(), name) == nullptr) == own) part[name] = value;
  return part;
}

LoadedController damped_for(double step, LoadedController loaded, const RobotModel& robot,
                            const ControllerOptions& options) {
  const JointGains gains = standing_gains(*loaded.make(options), robot);
  Eigen::VectorXd most = gains_for_explicit_step(robot, gains, step).kd;
  for (int j = 0; j < robot.dof(); ++j)
    if (most[j] < gains.kd[j])
      loaded.notes.push_back(fmt::format("kd of {}: {:.3g} in the place of {:.3g} N m s/rad (explicit_step {:g} s)",
                                         robot.joints[j].name, most[j], gains.kd[j], step));
    else
      most[j] = std::numeric_limits<double>::infinity();
  loaded.make = [make = loaded.make, most = std::move(most)](const ControllerOptions& now) {
    return make_damped_at_most(make(now), most);
  };
  return loaded;
}

// A controller by name: what is said of it, and how it is made once its options are known to be its own.
struct Entry {
  const char* name;
  ControllerInfo (*info)(const std::string& name);
  LoadedController (*load)(const std::string& name, Robot robot, const ControllerOptions& options);
  LoadedFiles (*files)(const std::string& name, const ControllerOptions& options);
};

LoadedFiles no_files(const std::string&, const ControllerOptions&) { return {}; }

ControllerInfo pd_info(const std::string& name) {
  return {name, "The card's gains around the reference's joint angles, without balance", "", false, {}};
}
LoadedController load_pd(const std::string&, Robot robot, const ControllerOptions&) {
  return {[robot = std::move(robot)](const ControllerOptions&) { return make_pd_controller(robot); }};
}

ControllerInfo vmc_info(const std::string& name) {
  return {name, "Inverse dynamics with planned contact forces; balances on both feet and does not step", "", false, {}};
}
LoadedController load_vmc(const std::string&, Robot robot, const ControllerOptions&) {
  return {[robot = std::move(robot)](const ControllerOptions&) { return make_vmc_controller(robot); }};
}

ControllerInfo wbc_sim_entry(const std::string&) { return wbc_sim_info(); }
LoadedController load_wbc_sim(const std::string&, Robot robot, const ControllerOptions& options) {
  auto network = std::make_shared<const WbcNetwork>(load_wbc_network(wbc_sim_network_path(options), *robot));
  return {[robot = std::move(robot), network](const ControllerOptions&) {
    return make_wbc_sim_controller(robot, network);
  }};
}

LoadedFiles wbc_sim_files(const std::string&, const ControllerOptions& options) {
  return {{"network", wbc_sim_network_path(options)}};
}

ControllerInfo published_info(const std::string& name) { return descriptor_info(load_descriptor(name)); }
LoadedController load_published(const std::string& name, Robot robot, const ControllerOptions& options) {
  const ToldLoader told = load_told(name, std::move(robot), options);
  return {[make = told.make](const ControllerOptions& now) { return make(now, nullptr); }, told.notes};
}

constexpr Entry kControllers[] = {{"pd", pd_info, load_pd, no_files},
                                  {"vmc", vmc_info, load_vmc, no_files},
                                  {"wbc_sim", wbc_sim_entry, load_wbc_sim, wbc_sim_files},
                                  {"homie", published_info, load_published, published_files},
                                  {"twist2", published_info, load_published, published_files},
                                  {"playground", published_info, load_published, published_files},
                                  {"rl_gym", published_info, load_published, published_files},
                                  {"gmt", published_info, load_published, published_files},
                                  {"beyond_mimic", published_info, load_published, published_files},
                                  {"holosoma", published_info, load_published, published_files},
                                  {"holosoma_fastsac", published_info, load_published, published_files},
                                  {"holosoma_t1", published_info, load_published, published_files},
                                  {"falcon", published_info, load_published, published_files},
                                  {"falcon_dec_loco", published_info, load_published, published_files},
                                  {"unitree_rl_lab", published_info, load_published, published_files},
                                  {"unitree_rl_mjlab", published_info, load_published, published_files},
                                  {"rl_sar_dance", published_info, load_published, published_files},
                                  {"g1_deploy_velocity", published_info, load_published, published_files},
                                  {"g1_deploy_amp", published_info, load_published, published_files},
                                  {"spinkick", published_info, load_published, published_files},
                                  {"booster_gym", published_info, load_published, published_files},
                                  {"playground_t1", published_info, load_published, published_files},
                                  {"rl_gym_h1", published_info, load_published, published_files},
                                  {"rl_gym_h1_2", published_info, load_published, published_files},
                                  {"agibot_x1", published_info, load_published, published_files},
                                  {"humanoid_gym", published_info, load_published, published_files}};
// A name that is the path of an IO descriptor.
constexpr Entry kDescriptor = {"", published_info, load_published, published_files};

// One that a program has added.
struct Registered {
  std::string name;
  ControllerInfo about;
  ControllerMaker maker;
};

// The one list that changes while a program runs: what a program adds has to be found by name wherever names are read.
OpenRegistry<Registered>& registered() {
  static OpenRegistry<Registered> registry;
  return registry;
}

ControllerInfo registered_info(const std::string& name) { return registered().find(name)->about; }
LoadedController load_registered(const std::string& name, Robot robot, const ControllerOptions&) {
  return {[name, robot = std::move(robot), maker = registered().find(name)->maker](const ControllerOptions& options) {
    std::unique_ptr<Controller> controller = maker(robot, options);
    require(controller != nullptr, "controller '{}': its maker made none", name);
    return controller;
  }};
}
constexpr Entry kRegistered = {"", registered_info, load_registered, no_files};

std::vector<std::string> shipped_names() { return names_of(kControllers); }

const Entry& find_entry(const std::string& name) {
  if (name.ends_with(".yaml")) return kDescriptor;
  for (const Entry& entry : kControllers)
    if (name == entry.name) return entry;
  if (registered().find(name) != nullptr) return kRegistered;
  throw std::invalid_argument(unknown_name_message("controller", name, controller_names()));
}

}  // namespace

std::vector<ControllerInfo> controllers() {
  std::vector<ControllerInfo> infos;
  for (const Entry& entry : kControllers) infos.push_back(entry.info(entry.name));
  for (const Registered* entry : registered().all()) infos.push_back(entry->about);
  return infos;
}

std::vector<std::string> controller_names() {
  std::vector<std::string> names = shipped_names();
  for (const Registered* entry : registered().all()) names.push_back(entry->name);
  return names;
}

void register_controller(const ControllerInfo& info, ControllerMaker make) {
  require(make != nullptr, "controller '{}': expected a function that makes it, found none", info.name);
  registered().add("controller", {info.name, info, std::move(make)}, shipped_names());
}

ControllerInfo controller_info(const std::string& name) { return find_entry(name).info(name); }

LoadedFiles controller_files(const std::string& name, const ControllerOptions& options) {
  return find_entry(name).files(name, part_of(options, true));
}

void check_controller_options(const ControllerInfo& info, const ControllerOptions& options) {
  std::vector<std::string> known = names_of(info.options);
  for (const ControllerOption& option : common_controller_options()) known.push_back(option.name);
  check_options("controller", info.name, options, known);
}

std::vector<ControllerOption> common_controller_options() { return option_list<ControllerOption>(common_table()); }

std::unique_ptr<Controller> make_controller(const std::string& name, const std::shared_ptr<const RobotModel>& robot,
                                            const ControllerOptions& options) {
  return load_controller(name, robot, options).make(options);
}

LoadedController load_controller(const std::string& name, const std::shared_ptr<const RobotModel>& robot,
                                 const ControllerOptions& options) {
  require(robot != nullptr, "make_controller: no robot");
  const Entry& entry = find_entry(name);
  check_controller_options(entry.info(name), options);
  const CommonOptions common = read_options("controller", name, common_table(), part_of(options, false));
  LoadedController loaded = entry.load(name, robot, part_of(options, true));
  if (common.reference_arms)
    loaded.make = [robot, make = loaded.make](const ControllerOptions& now) {
      return make_reference_arms(make(now), *robot);
    };
  LoadedController guarded = {[robot, make = loaded.make](const ControllerOptions& now) {
                                return make_guarded(make(part_of(now, true)), robot);
                              },
                              loaded.notes};
  return common.explicit_step == 0.0 ? guarded : damped_for(common.explicit_step, std::move(guarded), *robot, options);
}

namespace {

JointGains gains_of(const Descriptor& descriptor, const RobotModel& robot) {
  const JointCommand card = robot.default_command(robot.neutral);
  JointGains gains{card.kp, card.kd};
  const auto take = [&](const auto& joints) {
    for (const auto& joint : joints) {
      const auto found = std::ranges::find(robot.joints, joint.name, &RobotJoint::name);
      if (found == robot.joints.end()) continue;
      gains.kp[found - robot.joints.begin()] = joint.kp;
      gains.kd[found - robot.joints.begin()] = joint.kd;
    }
  };
  take(descriptor.other_joints);
  take(descriptor.joints);
  return gains;
}

}  // namespace

JointGains standing_gains(Controller& controller, const RobotModel& robot) {
  const RobotState state = robot.standing_state();
  JointCommand command = robot.default_command(state.q);
  controller.reset(state);
  controller.act(state, {state.X_WB, state.q}, command);
  return {command.kp, command.kd};
}

JointGains standing_gains(const std::string& name, const std::shared_ptr<const RobotModel>& robot,
                          const ControllerOptions& options) {
  if (find_entry(name).load == load_published) return gains_of(load_descriptor(name), *robot);
  return standing_gains(*make_controller(name, robot, options), *robot);
}

namespace {

std::vector<std::string> network_places(const Descriptor& descriptor, const std::string& file) {
  return published_places(std::filesystem::path(descriptor.file).parent_path().string(), file);
}

}  // namespace

Descriptor load_descriptor(const std::string& name) {
  if (name.ends_with(".yaml")) return read_descriptor(name);
  return read_descriptor(share_file("IO descriptor", fmt::format("controllers/descriptors/{}.yaml", name)));
}

namespace {

// "; SHA-256 0123...", of a published network whose digest is known (controllers/networks.sha256); else "".
std::string known_digest(const std::string& network) {
  std::istringstream lines(read_file(share_file("digests of networks", "controllers/networks.sha256")));
  for (std::string digest, name; lines >> digest >> name;)
    if (name == network) return fmt::format("; SHA-256 {}", digest);
  return "";
}

}  // namespace

std::string find_network(const Descriptor& descriptor, const ControllerOptions& options) {
  const auto given = options.find("network");
  const std::vector<std::string> places =
      given == options.end() ? network_places(descriptor, descriptor.network) : std::vector<std::string>{given->second};
  try {
    return first_existing(fmt::format("network of the controller '{}'", descriptor.name), places);
  } catch (const MissingError& error) {
    throw MissingError(fmt::format("{} (the option 'network' or DUET_MODELS says where it is{})", error.what(),
                                   given == options.end() ? known_digest(descriptor.network) : ""));
  }
}

namespace {

std::string find_other(const Descriptor& descriptor, const OtherNetwork& network) {
  try {
    return first_existing(fmt::format("network '{}' of the controller '{}'", network.name, descriptor.name),
                          network_places(descriptor, network.file));
  } catch (const MissingError& error) {
    throw MissingError(fmt::format("{} (DUET_MODELS says where it is{})", error.what(), known_digest(network.file)));
  }
}

}  // namespace

NetworkFile load_networks(const Descriptor& descriptor, const ControllerOptions& options) {
  const std::string engine = option_or(options, "engine", "duet");
  NetworkFile policy = load_network_file(find_network(descriptor, options), engine);
  if (descriptor.networks.empty()) return policy;
  std::vector<NetworkMaker> makers;
  for (const OtherNetwork& network : descriptor.networks)
    makers.push_back(load_network_file(find_other(descriptor, network), engine).make);
  makers.push_back(policy.make);
  policy.make = [descriptor, makers] {
    std::vector<std::unique_ptr<Network>> networks;
    networks.reserve(makers.size());
    for (const NetworkMaker& make : makers) networks.push_back(make());
    return compose_networks(descriptor, std::move(networks));
  };
  return policy;
}

LoadedFiles published_files(const std::string& name, const ControllerOptions& options) {
  const Descriptor descriptor = load_descriptor(name);
  LoadedFiles files = {{"descriptor", descriptor.file}};
  for (LoadedFile& file : network_files(find_network(descriptor, options))) files.push_back(std::move(file));
  for (const OtherNetwork& network : descriptor.networks)
    for (LoadedFile& file : network_files(find_other(descriptor, network))) {
      file.role = fmt::format("{} {}", network.name, file.role);
      files.push_back(std::move(file));
    }
  return files;
}

ToldLoader load_told(const std::string& name, std::shared_ptr<const RobotModel> robot,
                     const ControllerOptions& options) {
  const Descriptor descriptor = load_descriptor(name);
  const std::string path = find_network(descriptor, options);
  const NetworkFile network = load_networks(descriptor, options);
  return {[=, robot = std::move(robot), make = network.make](const ControllerOptions& now,
                                                             std::shared_ptr<const VelocityCommand> told) {
            return make_descriptor_controller(descriptor, robot, make(), path, now, std::move(told));
          },
          compare_with_network(descriptor, network.metadata, path)};
}

}  // namespace duet
