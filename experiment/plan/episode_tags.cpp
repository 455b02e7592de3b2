#include "duet/experiment/plan/episode_tags.h"

#include <utility>

namespace duet {
namespace {

void add_tags(std::string_view of, const Tags& tags, Tags& into) {
  for (const auto& [name, value] : tags) into.insert_or_assign(row_tag(of, name), value);
}

}  // namespace

Tags with_named_tags(Tags of_perturbation, const Suite& suite, const std::string& clip, const std::string& policy) {
  Tags tags = std::move(of_perturbation);
  if (suite.references.empty())
    add_tags(kOfPolicy, policy_of(suite, policy).tags, tags);
  else
    add_tags(kOfClip, reference_of(suite.references, clip).tags, tags);
  return tags;
}

Tags episode_tags(Tags of_perturbation, const Suite& suite, const PairedMotion& clip, const std::string& policy) {
  Tags tags = with_named_tags(std::move(of_perturbation), suite, clip.clip_id, policy);
  tags.insert(clip.tags.begin(), clip.tags.end());
  return tags;
}

}  // namespace duet
