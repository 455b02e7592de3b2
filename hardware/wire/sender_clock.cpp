#include "duet/hardware/wire/sender_clock.h"

#include <algorithm>
#include <cmath>

namespace duet {
namespace {

constexpr double kMostPeriods = 50.0;  // a robot that was silent for longer is damped
constexpr double kLearnFor = 1.0;      // the unit of the count [s]
constexpr double kWholeUnit = 0.001;   // [s]
constexpr double kUnitMargin = 0.1;    // by which a count may be off its unit while it is learnt

}  // namespace

double StateCount::periods_to(std::uint32_t tick) {
  const std::uint32_t rise = tick - tick_;
  tick_ = tick;
  if (!any_) {
    any_ = true;
    return 1.0;
  }
  least_rise_ = std::min(least_rise_, rise);
  return std::min(static_cast<double>(rise) / static_cast<double>(least_rise_), kMostPeriods);
}

double SenderDelay::see(double sent, double received) {
  const double way = received - sent;
  const bool goes_on = any_ && sent > sent_ && received >= received_ && received - received_ <= kSenderSilence;
  const double first = may_have_our_clock_ && way >= 0.0 && way <= kOneClock ? 0.0 : way;
  least_ = goes_on ? std::min(way, least_ + kClockDrift * (received - received_)) : first;
  sent_ = sent;
  received_ = received;
  any_ = true;
  return goes_on ? way - least_ : 0.0;
}

void StateDelay::learn_unit(std::uint32_t tick, double received) {
  const double passed = received - begin_;
  if (passed < kLearnFor) return;
  const double unit = passed / static_cast<double>(tick - first_);
  const double whole = kWholeUnit * std::round(unit / kWholeUnit);
  if (whole > 0.0 && std::abs(unit - whole) <= kUnitMargin * whole) unit_ = whole;
  first_ = tick;
  begin_ = received;
}

void StateDelay::see(std::uint32_t tick, double received) {
  const bool goes_on = any_ && tick != tick_ && received - received_ <= kSenderSilence;
  if (!goes_on) {
    first_ = tick;
    begin_ = received;
    last_.fill(0.0);
  }
  if (goes_on && unit_ == 0.0) learn_unit(tick, received);
  // A count goes on past 2^32.
  time_ += goes_on ? unit_ * static_cast<double>(tick - tick_) : 0.0;
  any_ = true;
  tick_ = tick;
  received_ = received;
  if (unit_ == 0.0) return;
  last_[next_] = delay_.see(time_, received);
  next_ = (next_ + 1) % last_.size();
}

double StateDelay::steady() const { return *std::ranges::min_element(last_); }

}  // namespace duet
