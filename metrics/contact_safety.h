// The effect of the robot's contacts on the human partner: force, impulse and pressure per body region, held against a
// table of limits (metrics/contact_limits.h), and the list of single contacts. Fed once per physics step.
//
// Force of a region in a step: contacts of one robot link with one capsule add up as vectors (a pair); the region bears
// the larger of the vector sum over its pairs and its largest pair, so that a squeeze from two sides does not cancel.
// Left and right count as one region. A contact of a region, or of a pair, is a run of steps with force; gaps up to
// `bridge` belong to it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/episode_facts.h"
#include "duet/core/robot_state.h"
#include "duet/metrics/contact_limits.h"
#include "duet/robots/human_body.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Mean and minimum over the last samples of a signal that arrives one by one. The signal counts as zero before its
// first sample. No allocation after construction.

class SlidingMean {
 public:
  explicit SlidingMean(int length) : samples_(length, 0.0) {}

  // The mean over the last `length` samples, this one included.
  double push(double sample) {
    sum_ += sample - samples_[next_];
    samples_[next_] = sample;
    if (++next_ == samples_.size()) {
      next_ = 0;
      sum_ = std::accumulate(samples_.begin(), samples_.end(), 0.0);  // rounding errors live one window at most
    }
    return sum_ / static_cast<double>(samples_.size());
  }

  void clear() {
    samples_.assign(samples_.size(), 0.0);
    next_ = 0;
    sum_ = 0.0;
  }

 private:
  std::vector<double> samples_;
  std::size_t next_ = 0;
  double sum_ = 0.0;
};

class SlidingMinimum {
 public:
  explicit SlidingMinimum(int length) : candidates_(length) {}

  // The minimum over the last `length` samples, this one included; 0 before there are so many. Samples are >= 0.
  double push(double sample) {
    const auto length = static_cast<std::int64_t>(candidates_.size());
    if (size_ > 0 && candidates_[first_].index <= count_ - length) {
      first_ = (first_ + 1) % candidates_.size();
      --size_;
    }
    while (size_ > 0 && last().sample >= sample) --size_;
    ++size_;
    last() = {count_++, sample};
    return count_ < length ? 0.0 : candidates_[first_].sample;
  }

 private:
  struct Candidate {
    std::int64_t index = 0;
    double sample = 0.0;
  };

  Candidate& last() { return candidates_[(first_ + size_ - 1) % candidates_.size()]; }

  std::vector<Candidate> candidates_;  // ring: samples that may still become the minimum, rising
  std::size_t first_ = 0, size_ = 0;
  std::int64_t count_ = 0;
};

struct ContactSafetyOptions {
  double hold = 0.5;          // what lasts longer is quasi-static [s]
  double settle = 0.1;        // after it the blow of a touch is over [s]
  double bridge = 0.02;       // gaps up to this do not end a contact [s]
  double mean_window = 0.1;   // of the windowed mean [s]
  double least_force = 1e-3;  // contacts with less count as none [N]
  double least_patch = 1e-4;  // floor of the estimated contact patch [m^2]
  // Radii of the robot's surface by link, as from link_radii(); 0 or no entry: the default. [m]
  std::vector<double> link_radius = {};
  double default_link_radius = 0.03;  // [m]
  int max_events = 1024;              // ended and present ones in the result
  int max_pairs = 64;                 // pairs that may be in contact at once
};

// The smallest radius of each link's collision shapes (the sharpest edge counts), 0 where it has none. [m]
std::vector<double> link_radii(const RobotModel& robot);

// From the best to the worst.
enum class ContactFinding { kWithin, kUnlimited, kOver, kNotAllowed };
std::string_view contact_verdict_name(ContactFinding verdict);  // "within", "unlimited", "over", "not allowed"

struct RegionContact {
  std::string region;
  int contacts = 0;              // none: everything below is zero
  int transient_contacts = 0;    // those that have not lasted longer than `hold`
  double longest = 0.0;          // duration of the longest contact, bridged gaps included [s]
  double peak_force = 0.0;       // largest force of a step [N]
  double peak_pair_force = 0.0;  // largest force of one pair [N]
  // The largest force that was held: the largest level that, throughout some span of one contact longer than `hold`,
  // the mean over every `bridge` kept. [N]
  double quasi_static_force = 0.0;
  double transient_force = 0.0;  // largest force within the first `hold` of a contact [N]
  double settled_force = 0.0;    // largest force later than `settle` after a contact's begin [N]
  double impulse = 0.0;          // [N s]
  double windowed_mean = 0.0;    // largest mean over `mean_window`; before and after a contact counts zero [N]
  // Estimate: force of a pair over a circle of radius sqrt(2 R depth), 1/R = 1/R_capsule + 1/R_link, as spheres
  // overlap; not below `least_patch`. Largest of all pairs and steps. [N/cm^2]
  double pressure_n_cm2 = 0.0;

  // Figures over their limits [1]; absent where no limit is stated.
  // Where the table allows no transient contact, all force of a longer contact counts as quasi-static, and
  // transient_ratio is that ratio, plus one where there was a contact no longer than `hold`.
  std::optional<double> quasi_static_ratio;
  std::optional<double> transient_ratio;  // of peak_force: a blow late in a contact counts
  std::optional<double> pressure_ratio;   // against the quasi-static limit, whatever the duration
  std::optional<double> worst_ratio;      // the largest of the three
  // settled_force against the transient limit, or quasi_static_ratio where that is larger: what is left of the ratios
  // where the first blow of each contact is forgiven.
  std::optional<double> settled_ratio;
  ContactFinding verdict = ContactFinding::kWithin;  // a ratio of exactly 1 is within
};

// A contact as it is measured: by indices, from the first step's begin.
struct ContactEvent : ContactFacts {
  int link = -1;
  int capsule = -1;  // in HumanBody::capsules
  int region = -1;   // in ContactSafetyResult::regions
};

struct ContactSafetyResult {
  std::vector<RegionContact> regions;        // every region of the body, in the order of its capsules
  std::vector<ContactEvent> events;          // by begin, link, capsule
  std::int64_t events_left_out = 0;          // those past max_events
  std::int64_t contacts_unfollowed = 0;      // contacts of a step past max_pairs: in the regions, but in no event
  std::int64_t contacts_not_finite = 0;      // contacts of a step that were ignored
  double duration = 0.0;                     // [s]
  double peak_force = 0.0;                   // largest of the regions [N]
  double quasi_static_force = 0.0;           // largest of the regions [N]
  double impulse = 0.0;                      // of all regions [N s]
  std::optional<double> worst_ratio = {};    // largest of the regions; 0 without contact, absent without any limit
  std::optional<double> settled_ratio = {};  // likewise
  ContactFinding verdict = ContactFinding::kWithin;  // worst of the regions that were touched
  std::string limits;                                // "iso_ts_15066 (unverified limits)"
  bool limits_verified = false;
};

// One owner, one thread. add() does not allocate.
class ContactSafety {
 public:
  // `dt`: physics step [s]. Throws std::invalid_argument naming an option out of range, or a region of the body that
  // the limits lack.
  ContactSafety(const HumanBody& human, const ContactLimits& limits, double dt,
                const ContactSafetyOptions& options = {});

  // All contacts of one physics step (those with other sides are skipped), also where there is none. Throws
  // std::invalid_argument for a capsule that the body lacks.
  void add(std::span<const Contact> contacts);

  // The result of the steps so far; a contact that still lasts counts as it stands.
  [[nodiscard]] ContactSafetyResult result() const;

 private:
  struct Steps {  // options in steps
    int hold, bridge, mean, settle;
  };
  struct Capsule {
    double radius = 0.0;
    int region = 0;
  };
  struct Region {
    explicit Region(const Steps& steps);
    RegionContact figures;
    RegionLimits limits;
    SlidingMean bridge_mean, window_mean;
    SlidingMinimum held;
    std::int64_t begin = 0, last = 0;               // steps of the present or last contact
    bool lasting = false;                           // it has lasted longer than `hold`
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // of this step
    double largest_pair = 0.0;
  };
  struct Pair {
    explicit Pair(int window) : mean(window) {}
    ContactEvent event;
    SlidingMean mean;
    double patch_radius = 0.0;                      // R
    std::int64_t begin = 0, last = 0;               // steps
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // of this step
    double depth = 0.0;
  };

  static Steps in_steps(const ContactSafetyOptions& options, double dt);
  void add_contact(const Contact& contact);
  Pair* find_or_open(const Contact& contact);
  void end_step(Pair& pair);
  void end_step(Region& region);
  void begin_contact(Region& region);
  void bear(Region& region, double pair_force, double depth, double patch_radius) const;
  void close(std::size_t pair);
  [[nodiscard]] double patch_radius(int link, int capsule) const;

  ContactSafetyOptions options_;
  double dt_;
  Steps steps_;
  std::string limits_name_;
  bool limits_verified_;
  std::vector<Capsule> capsules_;
  std::vector<Region> regions_;
  std::vector<Pair> pairs_;  // the first `open_` are in contact
  std::size_t open_ = 0;
  std::vector<ContactEvent> events_;  // ended ones
  std::int64_t step_ = 0;
  std::int64_t events_left_out_ = 0, contacts_unfollowed_ = 0, contacts_not_finite_ = 0;
};

// For result rows: "human.peak_n", "human.settled_n", "human.impulse_ns", "human.worst_ratio", "human.limits_verified"
// (0 or 1) and, for each region that was touched, "human.<region>." with "peak_n", "quasi_static_n", "transient_n",
// "settled_n", "impulse_ns", "pressure_n_cm2", "worst_ratio". A figure that the result lacks is absent here.
std::map<std::string, double> contact_forces(const ContactSafetyResult& result);

// Headline figures by catalogue name: contact_peak_force, contact_quasi_static_force, contact_impulse,
// contact_limit_ratio.
std::map<std::string, double> contact_safety_metrics(const ContactSafetyResult& result);

}  // namespace duet
