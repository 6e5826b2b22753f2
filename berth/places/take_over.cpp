#include "berth/places/take_over.hpp"

namespace berth::places {

void take_over(SlotSpec& own, const SlotSpec& now) {
  own.spares = now.spares;
  own.also = now.also;
  own.replacement = now.replacement;
  own.when_ambiguous = now.when_ambiguous;
}

}  // namespace berth::places
