#include "duet/people/formats/inter/inter_x_actions.h"

#include <array>

namespace duet {
namespace {

constexpr std::array<const char*, 40> kInterXActions = {"Hug",
                                                        "Handshake",
                                                        "Wave",
                                                        "Grab",
                                                        "Hit",
                                                        "Kick",
                                                        "Posing",
                                                        "Push",
                                                        "Pull",
                                                        "Sit on leg",
                                                        "Slap",
                                                        "Pat on back",
                                                        "Point finger at",
                                                        "Walk towards",
                                                        "Knock over",
                                                        "Step on foot",
                                                        "High-five",
                                                        "Chase",
                                                        "Whisper in ear",
                                                        "Support with hand",
                                                        "Rock-paper-scissors",
                                                        "Dance",
                                                        "Link arms",
                                                        "Shoulder to shoulder",
                                                        "Bend",
                                                        "Carry on back",
                                                        "Massaging shoulder",
                                                        "Massaging leg",
                                                        "Hand wrestling",
                                                        "Chat",
                                                        "Pat on cheek",
                                                        "Thumb up",
                                                        "Touch head",
                                                        "Imitate",
                                                        "Kiss on cheek",
                                                        "Help up",
                                                        "Cover mouth",
                                                        "Look back",
                                                        "Block",
                                                        "Fly kiss"};

}  // namespace

std::optional<std::string> inter_x_action(const std::string& clip) {
  const std::size_t at = clip.find('A');
  if (clip.size() != 16 || clip[0] != 'G' || at != 8) return std::nullopt;
  int number = 0;
  for (std::size_t i = 9; i < 12; ++i) {
    if (clip[i] < '0' || clip[i] > '9') return std::nullopt;
    number = 10 * number + (clip[i] - '0');
  }
  if (number >= static_cast<int>(kInterXActions.size())) return std::nullopt;
  return kInterXActions[static_cast<std::size_t>(number)];
}

}  // namespace duet
