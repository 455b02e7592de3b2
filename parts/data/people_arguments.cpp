#include "duet/parts/data/people_arguments.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <utility>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet::cli {
namespace {

template <typename Value, std::size_t N>
using Names = std::array<std::pair<std::string_view, Value>, N>;

constexpr Names<Axis, 8> kAxes = {{{"x", Axis::kPlusX},
                                   {"y", Axis::kPlusY},
                                   {"z", Axis::kPlusZ},
                                   {"+y", Axis::kPlusY},
                                   {"+z", Axis::kPlusZ},
                                   {"-x", Axis::kMinusX},
                                   {"-y", Axis::kMinusY},
                                   {"-z", Axis::kMinusZ}}};
constexpr Names<Alignment, 3> kAlignments = {
    {{"none", Alignment::kNone}, {"floor", Alignment::kFloor}, {"contact", Alignment::kContact}}};
constexpr Names<Person, 2> kPersons = {{{"A", Person::kA}, {"B", Person::kB}}};

template <typename Value, std::size_t N>
Value named(const Names<Value, N>& names, std::string_view option, const std::string& text) {
  std::vector<std::string> known;
  for (const auto& [name, value] : names) {
    if (name == text) return value;
    known.emplace_back(name);
  }
  throw std::invalid_argument(fmt::format("{}: expected {}, found '{}'", option, fmt::join(known, ", "), text));
}

// A flag and its opposite; neither: detected.
std::optional<bool> either(bool yes, bool no, std::string_view names) {
  require(!(yes && no), "{} exclude each other", names);
  return yes ? std::optional(true) : no ? std::optional(false) : std::nullopt;
}

}  // namespace

void add_people_options(CLI::App& command, PeopleArguments& arguments) {
  command.add_option("--format", arguments.format, "`duet list people-formats` (default: recognised)");
  command.add_option("--task", arguments.task, "task of the clips (default: from their labels, else recognised)");
  command.add_option("--robot", arguments.reactor, "who the robot replaces: A or B (default: as annotated, else B)");
  PeopleOptions& options = arguments.options;
  const auto number = [&](const std::string& name, std::optional<double>& value, const std::string& what) {
    command.add_option_function<double>(
        name, [&value](double v) { value = v; }, what + " (default: detected)");
  };
  number("--units", options.metres_per_unit, "metres per unit of the file");
  number("--rate", options.rate_hz, "frames per second");
  number("--floor", options.floor, "height of the floor [m]");
  command.add_option("--up", arguments.up, "axis of the file that points up: x, y, z, -x, -y, -z (default: detected)");
  command.add_flag("--mirror", arguments.mirror, "left and right are exchanged in the file (default: detected)");
  command.add_flag("--no-mirror", arguments.no_mirror, "they are not");
  command.add_flag("--level", arguments.level, "turn the world until its floor is level (default: where it is not)");
  command.add_flag("--no-level", arguments.no_level, "leave it as it is");
  command.add_flag("--drop-t-pose", arguments.drop_t_pose, "frame 0 is an added T pose: drop it (default: detected)");
  command.add_flag("--keep-t-pose", arguments.keep_t_pose, "keep frame 0 whatever it is");
  command.add_option(
      "--skeleton", options.skeleton,
      "which joint each column is: `duet list joint-layouts`, a file with one name a line, or one of lines "
      "'left_hip: NAME' (of BVH files, too)");
  number("--fill-gaps", options.fill_gaps, "fill gaps of a joint up to this long, also at the ends [s]");
  command.add_flag("--still-partner", options.still_partner,
                   "files hold one person each: somebody who stands still is put in front of each");
  command.add_flag("--as-is", options.as_is, "take clips however implausible their people are");
  command.add_option("--body-model", options.body_model, "your SMPL, SMPL-H or SMPL-X file (NPZ or PKL)");
  command.add_option("--object", options.object,
                     "shape of the object that they carry: a mesh (.obj) or a box or points (.json), in metres");
  command.add_option("--align", arguments.align,
                     "put two people who were recorded apart into one world: floor or contact (default: refused)");
}

PeopleOptions people_options(const PeopleArguments& arguments) {
  PeopleOptions options = arguments.options;
  if (!arguments.task.empty()) options.task = parse_task(arguments.task);
  if (!arguments.reactor.empty()) options.reactor = named(kPersons, "--robot", arguments.reactor);
  if (!arguments.up.empty()) options.up = named(kAxes, "--up", arguments.up);
  if (!arguments.align.empty()) options.align = named(kAlignments, "--align", arguments.align);
  options.mirrored = either(arguments.mirror, arguments.no_mirror, "--mirror and --no-mirror");
  options.level = either(arguments.level, arguments.no_level, "--level and --no-level");
  options.drop_t_pose = either(arguments.drop_t_pose, arguments.keep_t_pose, "--drop-t-pose and --keep-t-pose");
  return options;
}

}  // namespace duet::cli
