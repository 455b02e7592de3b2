#include "duet/policies/function_words.h"

namespace duet {
namespace {

constexpr std::string_view kFunctionWords[] = {
    "a",    "an",  "and", "are",  "as",   "at",   "be",    "by",     "can",  "do",    "for",    "from",   "give",
    "go",   "he",  "her", "him",  "his",  "i",    "in",    "into",   "is",   "it",    "its",    "let",    "lets",
    "make", "me",  "my",  "now",  "of",   "off",  "on",    "one",    "or",   "other", "out",    "person", "please",
    "our",  "she", "so",  "some", "that", "the",  "their", "them",   "then", "they",  "this",   "to",     "towards",
    "up",   "us",  "we",  "with", "you",  "your", "human", "people", "big",  "very",  "partner"};

}  // namespace

std::span<const std::string_view> function_words() { return kFunctionWords; }

}  // namespace duet
