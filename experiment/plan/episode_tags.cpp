#include "duet/experiment/plan/episode_tags.h"

#include <utility>

namespace duet {
namespace {

void add_tags(std::string_view of, const Tags& tags, Tags& into) {
  for (const auto& [name, value] : tags) into.insert_or_assign(row_tag(of, name), value);
}

}  // namespace

Tags with_named_tags(Tags of_perturbation, const SuitePolicy& policy, const SuiteReference* command) {
  Tags tags = std::move(of_perturbation);
  if (command == nullptr)
    add_tags(kOfPolicy, policy.tags, tags);
  else
    add_tags(kOfClip, command->tags, tags);
  return tags;
}

Tags episode_tags(const EpisodeSpec& spec) {
  Tags tags = with_named_tags(spec.perturbation_tags.map(), *spec.policy, spec.reference);
  tags.insert(spec.clip->tags.begin(), spec.clip->tags.end());
  return tags;
}

}  // namespace duet
