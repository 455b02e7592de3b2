// `duet bench detectors`: how well detectors tell the acts apart, on synthetic clips or on recordings with labels.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "duet/app/cli/people_arguments.h"
#include "duet/app/command.h"

namespace duet::cli {

struct DetectorArguments {
  std::string clips = "200";  // how many synthetic ones a task, or where recordings are
  std::string labels, thresholds;
  bool strict = false, list = false, csv = false;
  PeopleArguments people;
};

// --clips, --labels, --thresholds, --strict, --list, --csv, and those of people_arguments.h.
void add_detector_options(CLI::App& command, DetectorArguments& arguments);

void run_bench_detectors(const Session& session, const DetectorArguments& arguments, int threads);

}  // namespace duet::cli
