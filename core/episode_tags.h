// Values by name, as text, that tables know of an episode beside its names. A suite says them, or they follow from what
// it runs; a row holds them from where it is made. Names of perturbations, policies and clips are parsed by nobody.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace duet {

using Tags = std::map<std::string, std::string, std::less<>>;

// In a row a tag's name begins with what it is of: "perturbation.", "clip." or "policy.".
inline constexpr std::string_view kOfPerturbation = "perturbation", kOfClip = "clip", kOfPolicy = "policy";
inline std::string row_tag(std::string_view of, std::string_view name) {
  return std::string(of).append(".").append(name);
}

// A perturbation's kinds ("push", "jitter+dropout"); where it is one value that is 0 in a clean episode, that
// value in SI units, its unit, which value it is ("push", "partner.shift_s"), and the other values of its kind.
inline constexpr std::string_view kKindsTag = "perturbation.kinds", kFamilyTag = "perturbation.family",
                                  kSizeTag = "perturbation.size", kUnitTag = "perturbation.unit",
                                  kBesideTag = "perturbation.beside";

// A perturbation that is one value, which is 0 in a clean episode: tables draw success over it.
struct PerturbationSize {
  std::string
      family;        // its kind ("jitter"), of a kind with several such values with the value's name: "partner.shift_s"
  double x = 0.0;    // in SI units
  std::string unit;  // "m", "s", ...; "" for none
  std::string beside;  // the kind's other values: "duration: 1, every: 4"
};

// A clip's tags: who its people are; the clip that shows the same recording in the other role, where there is one
// before it; what a variant asks for.
inline constexpr std::string_view kPeopleTag = "clip.people", kRecordingTag = "clip.recording", kSideTag = "clip.side",
                                  kHeightTag = "clip.target_height";
inline constexpr std::string_view kRecordedPeople = "recorded", kSyntheticPeople = "synthetic";

// That a suite sets and tables read: the rung of a ladder and its name, of perturbations and commands; what a policy is
// a training of, and the seed of that training.
inline constexpr std::string_view kMethodTag = "policy.method", kTrainingSeedTag = "policy.seed";

// Those that follow from what a suite runs: nobody may give them.
inline constexpr std::array<std::string_view, 9> kDerivedTags = {
    kKindsTag, kFamilyTag, kSizeTag, kUnitTag, kBesideTag, kPeopleTag, kRecordingTag, kSideTag, kHeightTag};
// Those of which a table needs a whole number, by the name that a suite gives them, and how many digits it may have.
struct WholeTag {
  std::string_view name;
  std::size_t digits;
};
inline constexpr std::array<WholeTag, 3> kWholeTags = {{{"level", 6}, {"stage", 6}, {"seed", 18}}};

}  // namespace duet
