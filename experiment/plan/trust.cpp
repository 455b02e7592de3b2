#include "duet/experiment/plan/trust.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/policies/external/descriptor.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestCommand = 400;  // shown [bytes]

std::vector<fs::path> trusted_folders() {
  std::vector<fs::path> folders;
  const char* setting = std::getenv("DUET_TRUSTED_FOLDERS");
  std::istringstream list(setting == nullptr ? "" : setting);
  for (std::string folder; std::getline(list, folder, ':');)
    if (fs::path(folder).is_absolute()) folders.push_back(fs::weakly_canonical(folder));
  return folders;
}

bool lies_in(const fs::path& path, const fs::path& folder) {
  const auto [rest, unused] = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return rest == folder.end() || rest->empty();  // "/a/" ends with an empty part
}

std::string command_line(const std::vector<std::string>& command) {
  return shown(fmt::format("{}", fmt::join(command, " ")), kLongestCommand);
}

std::string action_of(const PolicyDescriptor& descriptor) {
  if (descriptor.command.empty()) return fmt::format("connects to '{}'", shown(descriptor.socket));
  return fmt::format("runs '{}' in '{}'", command_line(descriptor.command),
                     shown(descriptor.folder(), kLongestCommand));
}

}  // namespace

std::vector<NamedProgram> programs_of(const SuitePolicy& policy) {
  if (!policy.use.ends_with(".yaml")) return {};
  const PolicyDescriptor descriptor = read_policy_descriptor(policy.use);
  if (descriptor.kind != PolicyKind::kProcess) return {};
  return {{fmt::format("policy '{}'", shown(policy.name)), policy.use, action_of(descriptor),
           in_trusted_folder(policy.use)}};
}

NamedProgram program_in(const std::string& who, const std::string& file, const std::vector<std::string>& command) {
  const std::string folder = fs::absolute(file).parent_path().lexically_normal().string();
  return {who, file, fmt::format("runs '{}' in '{}'", command_line(command), shown(folder, kLongestCommand)),
          in_trusted_folder(file)};
}

std::vector<NamedProgram> programs_of(const Suite& suite, const std::vector<std::string>& skipped) {
  std::vector<NamedProgram> programs;
  for (const SuitePolicy& policy : suite.policies) {
    if (std::find(skipped.begin(), skipped.end(), policy.name) != skipped.end()) continue;
    for (NamedProgram& program : programs_of(policy)) programs.push_back(std::move(program));
  }
  return programs;
}

std::string describe(const NamedProgram& program) {
  return fmt::format("{} of {} {}", program.who, shown(program.file, kLongestCommand), program.action);
}

void require_allowed(const std::vector<NamedProgram>& programs, bool allowed) {
  std::vector<std::string> refused;
  for (const NamedProgram& program : programs)
    if (!allowed && !program.trusted) refused.push_back(describe(program));
  if (!refused.empty())
    throw InputError(fmt::format("expected --allow-programs, or a folder in DUET_TRUSTED_FOLDERS, for: {}",
                                 fmt::join(refused, "; ")));
}

bool in_trusted_folder(const std::string& descriptor) {
  std::error_code error;
  const fs::path file = fs::canonical(descriptor, error);
  if (error) return false;
  const fs::path folder = fs::canonical(fs::absolute(descriptor).parent_path(), error);
  if (error) return false;
  const std::vector<fs::path> trusted = trusted_folders();
  return std::any_of(trusted.begin(), trusted.end(),
                     [&](const fs::path& root) { return lies_in(file, root) && lies_in(folder, root); });
}

}  // namespace duet
