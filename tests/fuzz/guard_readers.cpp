// Reports of the guard to its planner, and the log of a run read as a recording.
#include <cstring>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/log/run_report.h"
#include "tests/fuzz/reader.h"
#include "tests/hardware/guarded_twin.h"

namespace duet::fuzz {
namespace {

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::span<const std::byte> bytes_in(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

std::string report_sample(unsigned /*seed*/) {
  ReportBuffer buffer;
  encode(GuardReport(), buffer);
  return text_of(buffer);
}

void read_report(std::string_view bytes) {
  GuardReport report;
  (void)decode(bytes_in(bytes), report);
}

// A few ticks of a guard that runs.
std::string log_sample(unsigned /*seed*/) {
  static const std::string sample = [] {
    test::GuardedTwin robot;
    robot.start();
    robot.message.goal.emplace();
    const std::string path = scratch_folder() + "/sample.mcap";
    std::filesystem::remove(path);
    {
      RunLog log(path, test::twin_guard());
      for (int k = 0; k < 12; ++k) {
        robot.tick();
        log.add(robot.guard);
      }
    }
    return read_file(path);
  }();
  return sample;
}

void read_log(std::string_view bytes) { (void)recording_of_log(scratch_file("fuzz.mcap", bytes)); }

void read_log_report(std::string_view bytes) { (void)report_of_log(scratch_file("fuzz.mcap", bytes)); }

}  // namespace

std::vector<Reader> guard_readers() {
  return {{"guard_report", report_sample, read_report},
          {"log_recording", log_sample, read_log},
          {"log_report", log_sample, read_log_report}};
}

}  // namespace duet::fuzz
