// The options that vary from one synthesised clip to another.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace duet {

enum class Side { kLeft, kRight };

// The way in which the two act: that of the first generator (long acts, three metres apart at the start), that of
// recorded people, or one that varies more than these do (docs/synthesis.md).
enum class Likeness { kScripted, kPeople, kVaried };
inline constexpr std::array<std::string_view, 3> kLikenessNames = {"rehearsed", "people", "varied"};  // in this order

// How an act goes: done, done after a half-raised hand has waited, or broken off before anything touches.
enum class ActOutcome { kComplete, kHesitant, kAborted };
inline constexpr std::array<std::string_view, 3> kActOutcomeNames = {"complete", "hesitant", "aborted"};  // likewise

// Options of a clip; an empty field is drawn from (seed, task, index). Ranges and draws: docs/conventions.md.
struct SynthesisOptions {
  std::uint64_t seed = 42;
  int index = 0;
  std::optional<double> height_a{}, height_b{};  // of the bodies [m]
  std::optional<double> distance{};              // of the roots at the start [m]
  std::optional<double> angle{};                 // at which B stands off A's path at the start [rad]
  std::optional<Side> side{};                    // hand (handedness) of the act
  std::optional<double> target_height{};         // of the contact point or gesture above the ground [m]
  std::optional<double> speed{};                 // of walking [m/s]
  std::optional<double> style{};                 // 0 restrained ... 1 expansive
  std::optional<double> duration{};              // of the whole clip [s]; default as in Table S6 per task
  double rate_hz = 50.0;
  Likeness like = Likeness::kScripted;
  // Not with kScripted; such clips are cropped to the act unless told:
  std::optional<double> before{};       // standing before anything moves [s]
  std::optional<double> after{};        // standing after everything [s]
  std::optional<ActOutcome> outcome{};  // default: drawn
  // With kVaried only:
  std::optional<double> wait{};  // mean of the standing before, drawn without memory, in place of `before` [s]
  std::optional<bool> still{};   // of a gesture: whether B stands still, so that nobody announces it; default: drawn
};

}  // namespace duet
