#include "duet/rows/row_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <set>
#include <system_error>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

// The members that are long: they are not even parsed.
constexpr std::array<std::string_view, 3> kLeftInTheFile = {"contacts", "feet", "trace"};
constexpr std::size_t kUsualLine = 1 << 14;  // [bytes]

EpisodeRow row_of_field(std::string_view line, const std::string& name) {
  const nlohmann::json json = parse_json(scan_member(line, name), "episode row");
  EpisodeRow row;
  std::ranges::find(row_fields(), name, &RowField::name)->read(JsonNode(json, "episode row: " + name), row);
  return row;
}

}  // namespace

EpisodeRow row_without_traces(std::string_view line) {
  EpisodeRow row = row_from_json(parse_json(without_members(line, kLeftInTheFile), "episode row"));
  if (scan_member(line, "feet").starts_with('{')) row.feet.left_mm = row.feet.right_mm = {0};
  return row;
}

void make_lean(EpisodeRow& row, std::int64_t line_at) {
  FootTrace feet = std::move(row.feet);
  for (const RowField& field : row_fields())
    if (!field.use.tabled) field.clear(row);
  row.feet = std::move(feet);
  for (Verdict& verdict : row.verdicts) {
    verdict.margins.clear();
    if (verdict.version == "interaction") continue;  // which condition failed is a table
    verdict.parts.clear();
    verdict.values.clear();
  }
  row.line_at = line_at;
}

void share_names(EpisodeRow& row, NamePool& pool) {
  row.metrics.share_names(pool);
  row.forces.share_names(pool);
  row.tags.share(pool);
  for (Verdict& verdict : row.verdicts) {
    verdict.parts.share_names(pool);
    verdict.values.share_names(pool);
    verdict.margins.share_names(pool);
  }
}

struct RowFile::Open {
  explicit Open(const std::string& path) : descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor < 0)
      throw InputError(fmt::format("cannot read '{}': {}", path, std::generic_category().message(errno)));
  }
  ~Open() { ::close(descriptor); }
  Open(const Open&) = delete;
  Open& operator=(const Open&) = delete;
  int descriptor;
};

RowFile::RowFile(std::string path) : path_(std::move(path)), open_(std::make_shared<const Open>(path_)) {}

std::string RowFile::line_of(const EpisodeRow& row) const {
  require(open_ != nullptr, "a row that is held lean has a file");
  std::string line;
  for (std::size_t end = std::string::npos; end == std::string::npos; end = line.find('\n')) {
    const std::size_t had = line.size();
    line.resize(had + kUsualLine);
    const ssize_t count =
        ::pread(open_->descriptor, line.data() + had, kUsualLine, row.line_at + static_cast<off_t>(had));
    line.resize(had + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    if (count <= 0 || line.size() > static_cast<std::size_t>(kMostTextBytes)) break;
  }
  line.resize(std::min(line.find('\n'), line.size()));
  if (!line.starts_with('{') || scan_member(line, "key") != fmt::format("\"{}\"", row.key))
    throw InputError(fmt::format("{}: changed while it was read: the row {:.16} is not where it was", path_, row.key));
  return line;
}

StateTrace RowFile::trace(const EpisodeRow& row) const {
  return row.line_at < 0 ? row.trace : row_of_field(line_of(row), "trace").trace;
}

FootTrace RowFile::feet(const EpisodeRow& row) const {
  return row.line_at < 0 ? row.feet : row_of_field(line_of(row), "feet").feet;
}

namespace {

using Differences = std::vector<FieldDifference>;

constexpr std::size_t kLongestValue = 80;  // characters
constexpr std::size_t kMostNamed = 5;      // fields

std::string shown_field(const nlohmann::json* value) {
  if (value == nullptr) return "nothing";
  const std::string text = dumped(*value);
  return text.size() <= kLongestValue ? text : text.substr(0, kLongestValue) + "...";
}

bool is_list_of_objects(const nlohmann::json& json) { return json.is_array() && !json.empty() && json[0].is_object(); }

void compare(const std::string& field, const nlohmann::json* first, const nlohmann::json* second, Differences& found);

void compare_members(const std::string& field, const nlohmann::json& first, const nlohmann::json& second,
                     Differences& found) {
  std::set<std::string> names;
  for (const nlohmann::json* json : {&first, &second})
    for (const auto& [name, value] : json->items()) names.insert(name);
  const auto member = [](const nlohmann::json& json, const std::string& name) {
    const auto at = json.find(name);
    return at == json.end() ? nullptr : &*at;
  };
  for (const std::string& name : names)
    compare(field.empty() ? name : fmt::format("{}.{}", field, name), member(first, name), member(second, name), found);
}

void compare_items(const std::string& field, const nlohmann::json& first, const nlohmann::json& second,
                   Differences& found) {
  const auto item = [](const nlohmann::json& json, std::size_t i) { return i < json.size() ? &json[i] : nullptr; };
  for (std::size_t i = 0; i < std::max(first.size(), second.size()); ++i)
    compare(fmt::format("{}.{}", field, i), item(first, i), item(second, i), found);
}

void compare(const std::string& field, const nlohmann::json* first, const nlohmann::json* second, Differences& found) {
  if (first != nullptr && second != nullptr) {
    if (*first == *second) return;
    if (first->is_object() && second->is_object()) return compare_members(field, *first, *second, found);
    if (is_list_of_objects(*first) && is_list_of_objects(*second)) return compare_items(field, *first, *second, found);
    if (dumped(*first) == dumped(*second)) return;
  }
  found.push_back({field, shown_field(first), shown_field(second)});
}

nlohmann::json repeatable(EpisodeRow row, bool with_tags) {
  if (!with_tags) row.tags = {};
  nlohmann::json json = to_json(row);
  for (const RowField& field : row_fields())
    if (!field.use.repeats) json.erase(field.name);
  return json;
}

}  // namespace

bool has_ended(Outcome outcome) { return outcome != Outcome::kError && outcome != Outcome::kTimedOut; }

Stands which_stands(Outcome first, Outcome second) {
  constexpr int kRan = 3;
  const auto weight = [](Outcome outcome) {
    if (outcome == Outcome::kError) return 0;
    if (outcome == Outcome::kTimedOut) return 1;
    return outcome == Outcome::kUnsupported ? 2 : kRan;
  };
  if (weight(first) != weight(second)) return weight(first) > weight(second) ? Stands::kFirst : Stands::kSecond;
  return weight(first) == kRan ? Stands::kBothAgreed : Stands::kEither;
}

void note_outcome(const std::string& key, Outcome outcome, std::map<std::string, Outcome>& outcomes) {
  const auto [known, is_new] = outcomes.try_emplace(key, outcome);
  if (!is_new && which_stands(known->second, outcome) == Stands::kSecond) known->second = outcome;
}

std::vector<FieldDifference> row_differences(const EpisodeRow& first, const EpisodeRow& second) {
  const bool tagged = !first.tags.empty() && !second.tags.empty();
  const nlohmann::json left = repeatable(first, tagged), right = repeatable(second, tagged);
  Differences found;
  compare("", &left, &right, found);
  return found;
}

std::vector<std::string> differing_fields(const EpisodeRow& first, const EpisodeRow& second) {
  std::vector<std::string> names;
  for (const FieldDifference& difference : row_differences(first, second)) names.push_back(difference.field);
  return names;
}

std::string differences_text(std::vector<FieldDifference> differences) {
  std::stable_partition(differences.begin(), differences.end(), [](const FieldDifference& difference) {
    return difference.field.find('.') == std::string::npos;  // "state_hash" before a hundred metrics
  });
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < std::min(differences.size(), kMostNamed); ++i)
    texts.push_back(fmt::format("{}: {}, {}", differences[i].field, differences[i].first, differences[i].second));
  if (differences.size() > kMostNamed) texts.push_back(fmt::format("{} more", differences.size() - kMostNamed));
  return fmt::format("{}", fmt::join(texts, "; "));
}

}  // namespace duet
