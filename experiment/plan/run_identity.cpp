#include "duet/experiment/plan/run_identity.h"

#include <fmt/format.h>

#include <utility>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/digest.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/suite/suite.h"
#include "duet/metrics/detector.h"
#include "duet/policies/catalogue/registry.h"

namespace duet {
namespace {

using Options = std::map<std::string, std::string>;

bool is_descriptor(const std::string& use) { return use.ends_with(".yaml"); }

// A descriptor is one of the files, wherever it lies; so is what a path option names.
std::string said_of(const std::string& use, const Options& options) {
  std::string text = fmt::format("use: {}\n", is_descriptor(use) ? "descriptor" : use);
  for (const auto& [name, value] : options)
    if (!is_path_option(name)) text += fmt::format("option {}: {}:{}\n", name, value.size(), value);
  return text;
}

template <typename FilesOf>
ActorIdentity identity(std::string text, const FilesOf& files_of, FileDigests& digests) {
  ActorIdentity identity;
  const DigestReads reads(digests);
  try {
    for (const LoadedFile& file : files_of()) identity.files.push_back({file.role, file.path, digests.of(file.path)});
  } catch (const MissingError& error) {
    return {.digest = "", .files = {}, .absence = error.what()};
  }
  for (const HashedFile& file : identity.files) text += fmt::format("{}: {}\n", file.role, file.sha256);
  identity.digest = sha256_hex(text);
  return identity;
}

// URDF and card of each controller's body, the one that clips are retargeted to first.
std::string robots_text(const Suite& suite, const RobotModel& nominal) {
  const auto digest = [](const std::string& card) { return load_robot(card).digest; };
  std::string text = fmt::format("robot of clips: {}\n", nominal.digest);
  for (const SuiteController& controller : suite.controllers) {
    try {
      text += fmt::format("robot of {}: {}\n", controller.name, digest(suite.card_of(controller)));
    } catch (const MissingError&) {
      text += fmt::format("robot of {}: absent\n", controller.name);
    }
  }
  return text;
}

std::string limits_digest(const Suite& suite, FileDigests& files) {
  return scene_mode(suite.partner) == PartnerMode::kSolid ? files.of(suite.contact_limits_file()) : "";
}

SuiteController without_places(SuiteController controller, FileDigests& files) {
  if (is_descriptor(controller.use)) controller.use = files.of(controller.use);
  std::erase_if(controller.options, [](const auto& option) { return is_path_option(option.first); });
  return controller;
}

std::string hash_of(const Suite& suite, FileDigests& files) {
  const DigestReads reads(files);
  Suite said = suite;
  said.policies.clear();
  said.engines.clear();
  said.clear_tags();
  said.robot.clear();  // robots_text
  for (std::string& file : said.clips.files) file = files.of(file);
  said.contact_limits = limits_digest(suite, files);
  for (SuiteController& controller : said.controllers) controller = without_places(controller, files);
  const RobotModel nominal = load_robot(suite.card());
  for (Perturbation& perturbation : said.perturbations) perturbation = with_links(perturbation, nominal);
  return sha256_hex(
      fmt::format("{}{}detectors: {}\n", resolved_yaml(said), robots_text(suite, nominal), kDetectorsVersion));
}

}  // namespace

ActorIdentity identity_of(const SuitePolicy& policy, FileDigests& files) {
  const std::string text =
      fmt::format("policy\n{}prompt: {}:{}\npartner: {}\n", said_of(policy.use, policy.options), policy.prompt.size(),
                  policy.prompt, policy.shuffled_partner ? "shuffled" : "own");
  return identity(
      text, [&] { return policy_files(policy.use, policy.options); }, files);
}

ActorIdentity identity_of(const SuiteController& controller, FileDigests& files) {
  return identity(
      "controller\n" + said_of(controller.use, controller.options),
      [&] { return controller_files(controller.use, controller.options); }, files);
}

ActorIdentity identity_of(const SuitePolicy& policy) {
  FileDigests files;
  return identity_of(policy, files);
}

ActorIdentity identity_of(const SuiteController& controller) {
  FileDigests files;
  return identity_of(controller, files);
}

std::string suite_hash(const Suite& suite, FileDigests files) { return hash_of(suite, files); }

RunIdentity identity_of(const Suite& suite, FileDigests files) {
  RunIdentity identity{.suite_hash = hash_of(suite, files)};
  for (const SuitePolicy& policy : suite.policies) identity.policies[policy.name] = identity_of(policy, files).digest;
  for (const std::string& control : suite.controls)
    identity.policies[control] = identity_of(SuitePolicy{control}, files).digest;
  identity.policies[kNullPolicy] = identity_of(SuitePolicy{kNullPolicy}, files).digest;
  for (const SuiteController& controller : suite.controllers)
    identity.controllers[controller.name] = identity_of(controller, files).digest;
  identity.files = std::move(files);
  return identity;
}

}  // namespace duet
