#include "duet/parts/data/part.h"

#include <fmt/format.h>

#include "duet/datasets/curation.h"
#include "duet/formats/robot_motion_format.h"
#include "duet/people/formats/people_formats.h"

namespace duet {
namespace {

std::vector<Listed> list_people_formats() {
  std::vector<Listed> list;
  for (const PeopleFormat& format : people_formats())
    list.push_back(
        {std::string(format.name),
         fmt::format("{}{}", format.what, format.licence.empty() ? "" : fmt::format("; licence {}", format.licence))});
  return list;
}

std::vector<Listed> list_curation_criteria() {
  std::vector<Listed> list;
  for (const CriterionInfo& info : curation_criteria())
    list.push_back({std::string(info.name), fmt::format("{}: {} {} {:g} {}", to_string(info.gate), info.title,
                                                        info.at_most ? "at most" : "at least", info.limit, info.unit)});
  return list;
}

std::vector<Listed> list_robot_formats() {
  std::vector<Listed> list;
  for (const RobotMotionFormat& format : robot_motion_formats()) {
    const bool written = format.write != nullptr;
    Listed entry{format.name, fmt::format("{}; {}", written ? "read and written" : "read", format.about)};
    entry.options = {format.holds, documented_layout(format),
                     fmt::format("looked up in {}; licence: {}", format.evidence, format.licence)};
    entry.more = {{"written", written},
                  {"quaternion", to_string(format.layout.quaternion)},
                  {"joints", to_string(format.layout.joints)},
                  {"angles", to_string(format.layout.angles)},
                  {"metres", format.layout.metres},
                  {"rate_hz", format.layout.rate_hz},
                  {"holds_rate", format.holds_rate}};
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace

Part data_part() {
  return {.name = "data",
          .commands = {{"import", cli::add_import}, {"convert", cli::add_convert}, {"dataset", cli::add_dataset}},
          .extensions = {{"score", cli::add_people_scoring}, {"bench", cli::add_detector_tables}},
          .lists = {{"people-formats", list_people_formats},
                    {"curation-criteria", list_curation_criteria},
                    {"robot-formats", list_robot_formats}},
          .option_lists = {},
          .benchmarks = {{"dataset", add_dataset_benchmarks}}};
}

}  // namespace duet
