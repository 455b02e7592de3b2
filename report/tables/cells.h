// Numbers as tables print them; "-" for one that is not finite. A number with an interval that is not finite stands
// alone.
#pragma once

#include <string>

#include "duet/statistics/statistics.h"

namespace duet {

std::string task_title(const std::string& task);    // "high_five" -> "High-five", "all" -> "Overall"
std::string count_cell(long count);                 // "126"
std::string counted(long count, const char* noun);  // "1 clip", "126 clips"
std::string decimals(double value, int digits);     // "0.84" for two
std::string decimals(double value, const Interval& interval, int digits);       // "0.84 [0.71, 0.92]"
std::string percent(double fraction);                                           // "84.9"
std::string percent(double fraction, const Interval& interval);                 // "84.9 [77.6, 90.1]"
std::string points(double difference, const Interval& interval = kNoInterval);  // "+12.3 [4.5, 20.1]"
std::string p_cell(double p);                                                   // "0.034", "<0.001"
std::string p_text(double p);                                                   // "p = 0.034", "p < 0.001"
std::string significant(double value);                                          // four significant digits
// Three significant digits as far as they are decimals, and at most so many of those: "0.162", "13.8", "2260".
std::string short_number(double value, int most_decimals = 3);
std::string short_number(double value, const Interval& interval, int most_decimals = 3);

}  // namespace duet
