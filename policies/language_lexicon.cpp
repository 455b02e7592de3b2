#include "policies/language_lexicon.h"

#include "policies/language.h"

namespace duet {
namespace {

constexpr LexiconEntry kLexicon[] = {
    {"hug", "hug", 1.0},
    {"embrace", "hug", 1.0},
    {"cuddle", "hug", 1.0},
    {"squeeze", "hug", 0.8},
    {"snuggle", "hug", 1.0},
    {"arms around", "hug", 1.0},
    {"open arms", "hug", 1.0},
    {"wrap", "hug", 0.6},
    {"hold close", "hug", 1.0},
    {"hold tight", "hug", 1.0},
    {"pull close", "hug", 1.0},
    {"handshake", "handshake", 1.0},
    {"shake", "handshake", 0.7},
    {"shake hand", "handshake", 1.0},
    {"hand shake", "handshake", 1.0},
    {"shook", "handshake", 0.7},
    {"shook hand", "handshake", 1.0},
    {"greet hand", "handshake", 1.0},
    {"clasp hand", "handshake", 1.0},
    {"grasp hand", "handshake", 1.0},
    {"grip hand", "handshake", 1.0},
    {"take hand", "handshake", 1.0},
    {"offer hand", "handshake", 1.0},
    {"extend hand", "handshake", 1.0},
    {"reach hand", "handshake", 1.0},
    {"high five", "high_five", 1.0},
    {"highfive", "high_five", 1.0},
    {"five", "high_five", 0.8},
    {"slap", "high_five", 0.8},
    {"slap palm", "high_five", 1.0},
    {"slap hand", "high_five", 1.0},
    {"clap hand", "high_five", 1.0},
    {"hit palm", "high_five", 1.0},
    {"tap palm", "high_five", 1.0},
    {"touch palm", "high_five", 1.0},
    {"palm", "high_five", 0.6},
    {"wave", "wave", 1.0},
    {"wave hand", "wave", 1.0},
    {"wave hello", "wave", 1.0},
    {"hello afar", "wave", 1.0},
    {"greet afar", "wave", 1.0},
    {"greet distance", "wave", 1.0},
    {"hello", "wave", 0.5},
    {"hi", "wave", 0.5},
    {"goodbye", "wave", 0.8},
    {"bye", "wave", 0.8},
    {"farewell", "wave", 0.8},
    {"afar", "wave", 0.4},
    {"bend", "bend", 1.0},
    {"bent", "bend", 1.0},
    {"bow", "bend", 1.0},
    {"curtsy", "bend", 1.0},
    {"lean forward", "bend", 1.0},
    {"lean down", "bend", 1.0},
    {"stoop", "bend", 1.0},
    {"lower head", "bend", 0.8},
    {"lower upper body", "bend", 1.0},
    {"incline", "bend", 0.8},
    {"fly kiss", "fly_kiss", 1.0},
    {"flying kiss", "fly_kiss", 1.0},
    {"blow kiss", "fly_kiss", 1.0},
    {"throw kiss", "fly_kiss", 1.0},
    {"send kiss", "fly_kiss", 1.0},
    {"air kiss", "fly_kiss", 1.0},
    {"kiss", "fly_kiss", 0.9},
    {"smooch", "fly_kiss", 0.9},
};

constexpr std::string_view kFunctionWords[] = {
    "a",    "an",  "and", "are",  "as",   "at",   "be",    "by",     "can",  "do",    "for",    "from",   "give",
    "go",   "he",  "her", "him",  "his",  "i",    "in",    "into",   "is",   "it",    "its",    "let",    "lets",
    "make", "me",  "my",  "now",  "of",   "off",  "on",    "one",    "or",   "other", "out",    "person", "please",
    "our",  "she", "so",  "some", "that", "the",  "their", "them",   "then", "they",  "this",   "to",     "towards",
    "up",   "us",  "we",  "with", "you",  "your", "human", "people", "big",  "very",  "partner"};

using Paraphrases = std::vector<std::string>;

const Paraphrases& hug_paraphrases() {
  static const Paraphrases texts = {"give the person a hug",
                                    "hug them",
                                    "embrace your partner",
                                    "wrap your arms around the person",
                                    "put both arms around him",
                                    "cuddle with the person in front of you",
                                    "hold her tight for a moment",
                                    "share a warm embrace",
                                    "go in for a hug",
                                    "squeeze the person gently",
                                    "welcome them with open arms",
                                    "hugging the human"};
  return texts;
}

const Paraphrases& handshake_paraphrases() {
  static const Paraphrases texts = {"shake hands with the person",
                                    "give the person a handshake",
                                    "greet them with your hand",
                                    "shake the partner's hand",
                                    "offer your hand to greet",
                                    "take his hand and shake it",
                                    "a formal handshake",
                                    "extend your right hand and shake",
                                    "reach out your hand to her",
                                    "do a hand shake",
                                    "shaking hands",
                                    "grasp the person's hand in greeting"};
  return texts;
}

const Paraphrases& high_five_paraphrases() {
  static const Paraphrases texts = {"give the person a high five",
                                    "high-five them",
                                    "slap palms with the person",
                                    "give me five",
                                    "highfive",
                                    "raise your hand and slap his palm",
                                    "clap hands with your partner",
                                    "hit palms up high",
                                    "up high, five",
                                    "celebrate with a high five",
                                    "touch palms above the head",
                                    "high fiving the human"};
  return texts;
}

const Paraphrases& wave_paraphrases() {
  static const Paraphrases texts = {"wave at the person",
                                    "wave hello",
                                    "wave your hand",
                                    "say hello from afar",
                                    "wave goodbye to them",
                                    "greet the person from a distance",
                                    "say hi with a wave",
                                    "waving to the human",
                                    "raise your arm and wave",
                                    "bid them farewell",
                                    "wave back",
                                    "say bye to her"};
  return texts;
}

const Paraphrases& bend_paraphrases() {
  static const Paraphrases texts = {"bow to the person",
                                    "bend down",
                                    "bend forward towards the person",
                                    "make a curtsy",
                                    "take a bow",
                                    "greet with a bow",
                                    "lean forward politely",
                                    "bowing to your partner",
                                    "bow your head and upper body",
                                    "bend at the waist",
                                    "show respect by bowing",
                                    "incline your body to them"};
  return texts;
}

const Paraphrases& fly_kiss_paraphrases() {
  static const Paraphrases texts = {"blow a kiss to the person",
                                    "send a flying kiss",
                                    "blow them a kiss",
                                    "throw a kiss to her",
                                    "kiss your hand and send it over",
                                    "make a fly kiss",
                                    "air kiss",
                                    "blowing kisses",
                                    "kiss your palm and blow it to him",
                                    "send a smooch through the air",
                                    "give a flying kiss to your partner",
                                    "a kiss from afar"};
  return texts;
}

}  // namespace

std::span<const LexiconEntry> language_lexicon() { return kLexicon; }
std::span<const std::string_view> function_words() { return kFunctionWords; }

std::string_view task_prompt(Task task) {
  switch (task) {
    case Task::kHug:
      return "hug the person";
    case Task::kHandshake:
      return "shake hands with the person";
    case Task::kHighFive:
      return "give the person a high five";
    case Task::kWave:
      return "wave to the person";
    case Task::kBend:
      return "bend down to the person";
    case Task::kFlyKiss:
      return "blow a kiss to the person";
  }
  return "";
}

const std::vector<std::string>& task_paraphrases(Task task) {
  switch (task) {
    case Task::kHug:
      return hug_paraphrases();
    case Task::kHandshake:
      return handshake_paraphrases();
    case Task::kHighFive:
      return high_five_paraphrases();
    case Task::kWave:
      return wave_paraphrases();
    case Task::kBend:
      return bend_paraphrases();
    case Task::kFlyKiss:
      return fly_kiss_paraphrases();
  }
  return hug_paraphrases();
}

}  // namespace duet
