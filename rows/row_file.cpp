#include "duet/rows/row_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <type_traits>
#include <utility>
#include <variant>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_scan.h"

namespace duet {
namespace {

// The members that are long: they are not even parsed.
constexpr std::array<std::string_view, 3> kLeftInTheFile = {"contacts", "feet", "trace"};
constexpr std::size_t kUsualLine = 1 << 14;  // [bytes]

template <typename Trace>
Trace trace_in(std::string_view line, const char* key) {
  const nlohmann::json json = {{key, parse_json(scan_member(line, key), "episode row")}};
  JsonFields fields(json, "episode row");
  Trace trace;
  read_value(fields, key, false, trace);
  return trace;
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
    if (!field.use.tabled)
      std::visit([&](auto member) { row.*member = std::remove_cvref_t<decltype(row.*member)>(); }, field.json.member);
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
  return row.line_at < 0 ? row.trace : trace_in<StateTrace>(line_of(row), "trace");
}

FootTrace RowFile::feet(const EpisodeRow& row) const {
  return row.line_at < 0 ? row.feet : trace_in<FootTrace>(line_of(row), "feet");
}

}  // namespace duet
