#include "duet/datasets/source_facts.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "duet/core/order_statistics.h"
#include "duet/core/parallel.h"
#include "duet/core/require.h"
#include "duet/datasets/curation.h"
#include "duet/datasets/people_clip.h"

namespace duet {
namespace {

constexpr std::size_t kSample = 32;
constexpr std::size_t kFewestRecordings = 5;
constexpr double kDigits = 100.0;  // what is usual is kept to 0.01

}  // namespace

std::map<std::string, int> count_labels(const PeopleFormat& format, const std::vector<ClipPlace>& places,
                                        const PeopleOptions& options, int threads) {
  std::vector<std::optional<std::string>> labels(places.size());
  parallel_for_each(static_cast<int>(places.size()), threads, [&](int i) {
    try {
      labels[i] = label_of(format, places[i], options);
    } catch (const InputError&) {  // its own entry says why
    }
  });
  std::map<std::string, int> counts;
  for (const std::optional<std::string>& label : labels)
    if (label) ++counts[*label];
  return counts;
}

double usual_bone_change(const PeopleFormat& format, const std::vector<ClipPlace>& places, const PeopleOptions& options,
                         int threads) {
  if (places.size() < kFewestRecordings) return 0.0;
  const std::size_t count = std::min(kSample, places.size());
  std::vector<std::optional<double>> changes(count);
  PeopleOptions any_task = options;
  any_task.as_is = true;
  if (!any_task.task) any_task.task = Task::kHandshake;  // bones are those of any task
  parallel_for_each(static_cast<int>(count), threads, [&](int i) {
    try {
      const ClipPlace& place = places[static_cast<std::size_t>(i) * places.size() / count];
      changes[i] = limb_bone_change(read_source_clip(format, place, any_task).clip);
    } catch (const InputError&) {  // its own entry says why
    }
  });
  std::vector<double> found;
  for (const std::optional<double>& change : changes)
    if (change) found.push_back(*change);
  return found.size() < kFewestRecordings ? 0.0 : std::round(kDigits * quantile(found, 0.5)) / kDigits;
}

}  // namespace duet
