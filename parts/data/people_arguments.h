// The options of every command that reads two-person motion of others.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "duet/motion/people/raw_people.h"

namespace duet::cli {

struct PeopleArguments {
  std::string format, task, reactor, up, align;
  bool mirror = false, no_mirror = false, level = false, no_level = false, drop_t_pose = false, keep_t_pose = false;
  PeopleOptions options;  // the numbers, and skeleton and body model
};

// --format, --task, --robot, --units, --up, --rate, --mirror, --level, --floor, --drop-t-pose, --skeleton,
// --fill-gaps, --still-partner, --body-model, --object, --align, each with its opposite where it has one.
void add_people_options(CLI::App& command, PeopleArguments& arguments);

// Throws std::invalid_argument for a value that is none of the option's.
PeopleOptions people_options(const PeopleArguments& arguments);

}  // namespace duet::cli
