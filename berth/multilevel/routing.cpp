#include "berth/multilevel/routing.hpp"

#include <algorithm>
#include <functional>

#include "berth/od/notation.hpp"

namespace berth::multilevel {
namespace {

constexpr std::uint16_t first_srdo = 0x1301, last_srdo = 0x13FF;
constexpr std::uint16_t first_srdo_mapping = 0x1381, last_srdo_mapping = 0x13C0;

std::string at(std::uint8_t side) { return " on side " + std::to_string(side); }

class Check {
 public:
  Check(const std::vector<Signal>& table, const std::vector<const od::Description*>& sides)
      : table_(&table), sides_(&sides), bad_(table.size()) {}

  std::vector<SignalProblem> run() {
    for (std::size_t i = 0; i < table_->size(); ++i) one(i);
    for (std::size_t i = 0; i < table_->size(); ++i) {
      if (!bad_[i]) doubles(i);
      if (!bad_[i]) loops(i);
    }
    return std::move(found_);
  }

 private:
  void tell(std::size_t signal, const std::string& text) {
    found_.push_back({signal, (*table_)[signal].name + ": " + text});
    bad_[signal] = true;
  }
  const od::SubObject* object(std::size_t signal, std::uint8_t side, ObjectRef ref) {
    if (side >= sides_->size()) {
      tell(signal, "there is no side " + std::to_string(side));
      return nullptr;
    }
    const auto& description = *(*sides_)[side];
    const auto* const sub = description.find(ref);
    if (sub == nullptr) {
      tell(signal, od::write_object(ref) + " is not there" + at(side));
    } else if (sub->variable_length()) {
      tell(signal, od::write_object(ref) + at(side) + " has no fixed size: no PDO carries it");
      return nullptr;
    } else if (is_safety_relevant(description, ref)) {
      tell(signal, od::write_object(ref) + at(side) +
                       " is safety-relevant (SRDO): it is never forwarded, as the gateway would have to be part of the"
                       " safety function");
      return nullptr;
    }
    return sub;
  }
  void one(std::size_t i) {
    const Signal& signal = (*table_)[i];
    if (signal.from == signal.to) return tell(i, "it begins and ends" + at(signal.from));
    const auto* const source = object(i, signal.from, signal.source);
    const auto* const target = object(i, signal.to, signal.target);
    if (source == nullptr || target == nullptr) return;
    if (source->capacity != target->capacity) {
      return tell(i, od::write_object(signal.source) + " has " + std::to_string(source->capacity) + " bytes, " +
                         od::write_object(signal.target) + " has " + std::to_string(target->capacity));
    }
    if (signal.stopped == Signal::Stopped::substitute && signal.substitute.size() != target->capacity) {
      tell(i, "its substitute has " + std::to_string(signal.substitute.size()) + " bytes, " +
                  od::write_object(signal.target) + " has " + std::to_string(target->capacity));
    }
  }
  void doubles(std::size_t i) {
    const Signal& signal = (*table_)[i];
    for (std::size_t k = 0; k < i; ++k) {
      const Signal& other = (*table_)[k];
      if (bad_[k]) continue;
      if (other.to == signal.to && other.target == signal.target && (other.modes & signal.modes) != 0) {
        return tell(i, od::write_object(signal.target) + at(signal.to) + " is the target of " + other.name +
                           " in the same mode");
      }
    }
  }
  // Does a path lead from its target back to its source? Reported for the first signal of a loop.
  void loops(std::size_t i) {
    std::vector<bool> seen(table_->size());
    const std::function<bool(std::size_t)> leads_back = [&](std::size_t from) {
      for (std::size_t k = 0; k < table_->size(); ++k) {
        if ((*table_)[k].from != (*table_)[from].to || (*table_)[k].source != (*table_)[from].target) continue;
        if (k == i) return true;
        if (k < i || seen[k] || bad_[k]) continue;
        seen[k] = true;
        if (leads_back(k)) return true;
      }
      return false;
    };
    if (leads_back(i)) tell(i, "it forms a loop");
  }

  const std::vector<Signal>* table_;
  const std::vector<const od::Description*>* sides_;
  std::vector<bool> bad_;
  std::vector<SignalProblem> found_;
};

}  // namespace

// An SRDO's mapping may name the object by default.
bool is_safety_relevant(const od::Description& description, ObjectRef ref) {
  if (ref.index >= first_srdo && ref.index <= last_srdo) return true;
  const auto wanted = static_cast<std::uint32_t>(ref.index) << 16U | static_cast<std::uint32_t>(ref.sub) << 8U;
  for (const auto& object : description.objects()) {
    if (object.index < first_srdo_mapping || object.index > last_srdo_mapping) continue;
    const auto maps = [&](const od::SubObject& sub) {
      const auto value = description.default_of(sub).resolve(sub.type, 0);
      return sub.sub != 0 && (value & 0xFFFF'FF00U) == wanted;
    };
    if (std::ranges::any_of(description.subs(object), maps)) return true;
  }
  return false;
}

std::vector<SignalProblem> problems(const std::vector<Signal>& table,
                                    const std::vector<const od::Description*>& sides) {
  return Check(table, sides).run();
}

}  // namespace berth::multilevel
