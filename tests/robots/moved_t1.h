// A robot whose origin is not in its pelvis.
#pragma once

#include <fmt/format.h>

#include <string>

#include "duet/core/file.h"
#include "tests/robots/fixtures.h"
#include "tests/support.h"

namespace duet::test {

// The T1 whose root is a link without mass, so far from the trunk: its origin is anywhere.
struct MovedT1 {
  ScratchFolder folder;
  std::string card = folder / "t1.yaml";

  explicit MovedT1(const Eigen::Vector3d& trunk, const std::string& fall = "fall: {height: 0.38, cos_tilt: 0.7}") {
    const std::string source = DUET_SOURCE_DIR "/robots/t1/";
    write_file(card, replaced(replaced(read_file(source + "t1.yaml"), "base: Trunk", "base: floor"),
                              "fall: {height: 0.38, cos_tilt: 0.7}", fall));
    write_file(folder / "t1.urdf",
               replaced(read_file(source + "t1.urdf"), "<link name=\"Trunk\">",
                        fmt::format("<link name=\"floor\"/><joint name=\"lift\" type=\"fixed\"><parent link=\"floor\"/>"
                                    "<child link=\"Trunk\"/><origin xyz=\"{} {} {}\"/></joint><link name=\"Trunk\">",
                                    trunk.x(), trunk.y(), trunk.z())));
  }
};

}  // namespace duet::test
