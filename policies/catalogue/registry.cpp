#include "duet/policies/catalogue/registry.h"

#include <algorithm>
#include <utility>

#include "duet/core/field.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/policies/averaged_partner.h"
#include "duet/policies/controls/control_policy.h"
#include "duet/policies/dstar/dstar_policy.h"
#include "duet/policies/dstar/retrieval.h"
#include "duet/policies/external/external_policy.h"
#include "duet/policies/hand_servo.h"
#include "duet/policies/reference_policies.h"

namespace duet {
namespace {

using Robot = std::shared_ptr<const RobotModel>;

// A policy by name: what is said of it, and how it is made once its options are known to be its own.
struct Entry {
  const char* name;
  PolicyInfo (*info)(const std::string& name);
  PolicyMaker (*maker)(const std::string& name, Robot robot, const PolicyOptions& options);
  LoadedFiles (*files)(const std::string& name, const PolicyOptions& options);
  PolicyRole role = {};
};

template <typename T>
PolicyMaker of(const std::string& name, Robot robot, const PolicyOptions&) {
  require(robot != nullptr, "policy '{}' needs a robot", name);
  return [robot] { return std::make_unique<T>(robot); };
}

PolicyInfo replay_info(const std::string& name) {
  return {name, "The retargeted motion with hindsight, as anchors", {}};
}
LoadedFiles no_files(const std::string&, const PolicyOptions&) { return {}; }
PolicyInfo dense_info(const std::string& name) { return {name, "The same at 50 Hz, past the anchors", {}}; }
PolicyInfo null_info(const std::string& name) { return {name, "Holds the neutral pose where it stands", {}}; }

constexpr PolicyRole kKnowsTheMotion = {ArmRole::kOracle, "knows the motion"};
constexpr PolicyRole kStandsStill = {ArmRole::kControl, "stands still"};
constexpr PolicyRole kScripted = {ArmRole::kControl, "scripted"};

PolicyInfo control_info(const std::string& name) {
  const auto found = std::ranges::find(control_scripts(), name, &ControlScript::name);
  return {name, std::string(found->about), {}};
}
PolicyMaker named_control(const std::string& name, Robot robot, const PolicyOptions&) {
  return control_maker(name, std::move(robot));
}

constexpr Entry kPolicies[] = {{"replay", replay_info, of<ReplayPolicy>, no_files, kKnowsTheMotion},
                               {"replay_dense", dense_info, of<DenseReplayPolicy>, no_files, kKnowsTheMotion},
                               {"null", null_info, of<NullPolicy>, no_files, kStandsStill},
                               {"dstar", dstar_info, dstar_maker, dstar_files},
                               {"dp", dstar_info, dstar_maker, dstar_files},
                               {"retrieval", retrieval_info, retrieval_maker, retrieval_files},
                               {"omni", control_info, named_control, no_files, kScripted},
                               {"canned", control_info, named_control, no_files, kScripted},
                               {"servo", control_info, named_control, no_files, kScripted},
                               {"raised", control_info, named_control, no_files, kScripted},
                               {"walker", control_info, named_control, no_files, kScripted},
                               {"forward", control_info, named_control, no_files, kScripted},
                               {"patient", control_info, named_control, no_files, kScripted},
                               {"mirror", control_info, named_control, no_files, kScripted},
                               {"waiting", control_info, named_control, no_files, kScripted},
                               {"vendor", control_info, named_control, no_files, kScripted}};

// A name that is the path of a policy descriptor.
constexpr Entry kDescriptor = {"", external_info, external_maker, external_files};

// A function of Python (python/environment_binding.cpp), which no list has: runs of it are read and compared wherever
// they are.
PolicyInfo function_info(const std::string& name) {
  return {name,
          "A function of Python that is called for all waiting episodes at once (duet.evaluate)",
          {{"source", "", "SHA-256 of what the function is"}}};
}
PolicyMaker function_maker(const std::string&, Robot,  // NOLINT(performance-unnecessary-value-param): as all makers
                           const PolicyOptions&) {
  throw MissingError("policy 'python' is a function: only the program that has it can run its episodes");
}
constexpr Entry kFunction = {"python", function_info, function_maker, no_files};

// One that a program has added.
struct Registered {
  std::string name;
  PolicyInfo about;
  PolicyLoader load;
};

// The one list that changes while a program runs: what a program adds has to be found by name wherever names are read.
OpenRegistry<Registered>& registered() {
  static OpenRegistry<Registered> registry;
  return registry;
}

PolicyInfo registered_info(const std::string& name) { return registered().find(name)->about; }
PolicyMaker registered_maker(const std::string& name, Robot robot, const PolicyOptions& options) {
  require(robot != nullptr, "policy '{}' needs a robot", name);
  PolicyMaker maker = registered().find(name)->load(std::move(robot), options);
  require(maker != nullptr, "policy '{}': its loader returned no maker", name);
  return maker;
}
constexpr Entry kRegistered = {"", registered_info, registered_maker, no_files};

std::vector<std::string> shipped_names() { return names_of(kPolicies); }

const Entry& find_entry(const std::string& name) {
  if (name.ends_with(".yaml")) return kDescriptor;
  for (const Entry& entry : kPolicies)
    if (name == entry.name) return entry;
  if (name == kFunction.name) return kFunction;
  if (registered().find(name) != nullptr) return kRegistered;
  throw std::invalid_argument(unknown_name_message("policy", name, policy_names()));
}

// Options that shipped policies and descriptors take beside their own.
struct CommonOptions {
  bool average = false;
  HandServoReach servo = HandServoReach::kNone;
};

const FieldTable<CommonOptions>& common_options() {
  static const FieldTable<CommonOptions> table = {
      field<CommonOptions>(
          {.name = kAverage,
           .meaning = "takes the partner where the last 0.24 s have them on average: a noisy one, too; "
                      "the arm's name has to say `average`"},
          &CommonOptions::average),
      field<CommonOptions>({.name = kHandServo,
                            .meaning = "in tasks of hand at hand, the arm's last decimetres (`wide`: in handshakes, "
                                       "half a metre) go to the partner's seen hand; the arm's name has to say `servo`",
                            .choices = {"false", "true", "wide"}},
                           &CommonOptions::servo)};
  return table;
}

bool takes(const Entry& entry) {
  return &entry != &kFunction && &entry != &kRegistered && entry.name != std::string_view("null");
}

PolicyInfo info_of(const Entry& entry, const std::string& name) {
  PolicyInfo info = entry.info(name);
  for (PolicyOption& option : common_policy_options())
    if (takes(entry)) info.options.push_back(std::move(option));
  return info;
}

// Takes the common options out of those of a policy, which knows nothing of them.
CommonOptions take_common(const Entry& entry, const std::string& name, PolicyOptions& options) {
  PolicyOptions taken;
  for (const PolicyOption& option : common_policy_options())
    if (takes(entry))
      if (auto node = options.extract(option.name)) taken.insert(std::move(node));
  return read_options("policy", name, common_options(), taken);
}

}  // namespace

std::vector<PolicyOption> common_policy_options() { return option_list<PolicyOption>(common_options()); }

std::vector<PolicyInfo> policies() {
  std::vector<PolicyInfo> infos;
  for (const Entry& entry : kPolicies) infos.push_back(entry.info(entry.name));
  for (const Registered* entry : registered().all()) infos.push_back(entry->about);
  return infos;
}

std::vector<std::string> policy_names() {
  std::vector<std::string> names = shipped_names();
  for (const Registered* entry : registered().all()) names.push_back(entry->name);
  return names;
}

void register_policy(const PolicyInfo& info, PolicyLoader load) {
  require(load != nullptr, "policy '{}': expected a function that loads it, found none", info.name);
  std::vector<std::string> taken = shipped_names();
  taken.emplace_back(kFunction.name);
  registered().add("policy", {info.name, info, std::move(load)}, taken);
}

PolicyInfo policy_info(const std::string& name) { return info_of(find_entry(name), name); }

PolicyRole policy_role(const std::string& name) {
  for (const Entry& entry : kPolicies)
    if (name == entry.name) return entry.role;
  return {};
}

LoadedFiles policy_files(const std::string& name, const PolicyOptions& options) {
  const Entry& entry = find_entry(name);
  PolicyOptions own = options;
  take_common(entry, name, own);
  return entry.files(name, own);
}

PolicyMaker policy_maker(const std::string& name, Robot robot, const PolicyOptions& options) {
  const Entry& entry = find_entry(name);
  const PolicyInfo info = info_of(entry, name);
  std::vector<std::string> known = names_of(info.options);
  check_options("policy", name, options, known);
  PolicyOptions own = options;
  const CommonOptions common = take_common(entry, name, own);
  PolicyMaker maker = entry.maker(name, robot, own);
  if (!common.average && common.servo == HandServoReach::kNone) return maker;
  return [maker = std::move(maker), robot = std::move(robot), common] {
    std::unique_ptr<Policy> policy = maker();
    if (common.servo != HandServoReach::kNone) policy = with_hand_servo(std::move(policy), robot, common.servo);
    return common.average ? with_averaged_partner(std::move(policy)) : std::move(policy);
  };
}

std::unique_ptr<Policy> make_policy(const std::string& name, Robot robot, const PolicyOptions& options) {
  return policy_maker(name, std::move(robot), options)();
}

}  // namespace duet
