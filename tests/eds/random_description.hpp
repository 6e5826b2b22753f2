/// Random device descriptions and files for property tests, and a word for what differs between two.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/eds/write.hpp"
#include "berth/od/values.hpp"

namespace berth::eds::test {

inline std::string random_word(Random& random, std::size_t most = 20) {
  static const std::string letters = "abcXYZ 0123_-/()%&+.,:;#=[]\"'\\$";
  std::string text(1 + random.below(most), ' ');
  for (char& c : text) c = letters[random.below(letters.size())];
  if (random.chance(100'000)) text += "\xC3\xA4\xE2\x82\xAC";  // ä€
  text.front() = 'n';
  text += 'e';
  // A ; behind a blank would begin a comment.
  for (std::size_t i = 1; i < text.size(); ++i) {
    if (text[i] == ';' && text[i - 1] == ' ') text[i] = '!';
  }
  return text;
}

inline od::Literal random_number(Random& random, od::DataType type) {
  using od::DataType;
  if (type == DataType::boolean) return od::Literal::number(random.below(2));
  if (od::is_real(type)) {
    return od::Literal::real(type, static_cast<double>(random.between(-1'000'000, 1'000'000)) / 64);
  }
  const std::uint64_t bits = random.chance(300'000) ? random.next() : random.below(1000);
  const std::uint64_t raw = od::wrap(type, random.chance(200'000) ? 0 - bits : bits);
  if (od::is_integer(type) && od::bit_length(type) >= 16 && random.chance(150'000)) {
    return od::Literal::node_id_plus(od::wrap(type, raw & 0x7FF));
  }
  return od::Literal::number(raw);
}

inline od::Literal random_value(Random& random, od::DataType type) {
  if (od::byte_size(type) != 0) return random_number(random, type);
  if (type == od::DataType::visible_string) return od::Literal::text(random_word(random));
  std::vector<std::uint8_t> bytes(2 + 2 * random.below(12));
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random.next());
  return od::Literal::octets(bytes);
}

/// A sub-object with its name in `name`, which the spec points into.
inline od::SubSpec random_spec(Random& random, std::uint8_t sub, std::string& name) {
  const auto all = od::all_data_types();
  od::SubSpec spec;
  name = random_word(random);
  spec.sub = sub;
  spec.name = name;
  spec.type = all[random.below(all.size())];
  spec.access = static_cast<od::Access>(random.below(6));
  spec.mappable = random.chance(300'000);
  spec.obj_flags = static_cast<std::uint8_t>(random.chance(800'000) ? 0 : random.below(4));
  if (random.chance(800'000)) spec.initial = random_value(random, spec.type);
  const bool ordered = od::byte_size(spec.type) != 0 && spec.type != od::DataType::boolean;
  if (ordered && random.chance(300'000)) {
    spec.low = random_number(random, spec.type);
    spec.high = random_number(random, spec.type);
    if (spec.low.kind != spec.high.kind) spec.high = {};
    if (spec.high.present() && od::compare(spec.type, spec.low.raw, spec.high.raw) > 0) std::swap(spec.low, spec.high);
  }
  return spec;
}

/// Some objects at random indices; records and arrays with holes; descriptions without a sub-index 0 too.
inline std::shared_ptr<const od::Description> random_description(Random& random) {
  od::DescriptionBuilder builder;
  std::string name;
  builder.dummies(static_cast<std::uint32_t>(random.next()) & 0xFE);
  constexpr std::array<std::uint16_t, 8> bases{0x1000, 0x1017, 0x1400, 0x1600, 0x2000, 0x5FF0, 0x6000, 0xA000};
  for (auto n = 1 + random.below(12); n != 0; --n) {
    const auto index = static_cast<std::uint16_t>(bases[random.below(bases.size())] + random.below(8));
    if (builder.has(index)) continue;
    if (random.chance(500'000)) {
      builder.variable(index, random_spec(random, 0, name));
      continue;
    }
    const auto code = random.chance(500'000)   ? od::ObjectCode::array
                      : random.chance(900'000) ? od::ObjectCode::record
                                               : od::ObjectCode::defstruct;
    const auto type = random.chance(700'000) ? od::DataType::none : od::DataType::unsigned16;
    const std::string object_name = random_word(random);
    builder.object(index, code, object_name, type, static_cast<std::uint8_t>(random.chance(900'000) ? 0 : 1));
    if (random.chance(700'000)) {
      builder.sub(index, {.sub = 0,
                          .name = "count",
                          .type = od::DataType::unsigned8,
                          .access = random.chance(500'000) ? od::Access::ro : od::Access::rw,
                          .initial = random.chance(500'000) ? od::Literal::number(random.below(255)) : od::Literal{}});
    }
    for (auto m = 1 + random.below(5); m != 0; --m) {
      const auto sub = static_cast<std::uint8_t>(random.chance(50'000) ? 0xFF : 1 + random.below(12));
      builder.sub(index, random_spec(random, sub, name));
    }
  }
  return builder.build();
}

inline std::string text_of_literal(const od::Literal& value) {
  std::string text = std::to_string(static_cast<int>(value.kind)) + "/" + std::to_string(value.raw) + "/";
  for (const auto byte : value.bytes) text += std::to_string(byte) + " ";
  return text;
}

/// "" when two descriptions say the same, but for what an EDS does not carry: capacities, and whether a count that can
/// only have one value is written out.
inline std::string difference(const od::Description& a, const od::Description& b) {
  if (a.objects().size() != b.objects().size()) return "number of objects";
  for (std::uint16_t type = 0; type < 0x1C; ++type) {
    if (a.dummy_mappable(type) != b.dummy_mappable(type)) return "dummy " + std::to_string(type);
  }
  for (std::size_t i = 0; i < a.objects().size(); ++i) {
    const od::Object& x = a.objects()[i];
    const od::Object& y = b.objects()[i];
    const std::string where = std::to_string(x.index);
    if (x.index != y.index || x.code != y.code || x.obj_flags != y.obj_flags) return where;
    // Of an ARRAY or RECORD it stands with the sub-objects.
    const bool simple =
        x.code != od::ObjectCode::array && x.code != od::ObjectCode::record && x.code != od::ObjectCode::defstruct;
    if (simple && x.type != y.type) return where + " type";
    if (a.name(x) != b.name(y)) return where + " name " + std::string(a.name(x)) + "/" + std::string(b.name(y));
    if (x.count != y.count) return where + " count";
    for (std::size_t k = 0; k < x.count; ++k) {
      const od::SubObject& s = a.subs(x)[k];
      const od::SubObject& t = b.subs(y)[k];
      const std::string here = where + ":" + std::to_string(s.sub);
      if (s.sub != t.sub || s.type != t.type || s.access != t.access || s.mappable != t.mappable) return here + " kind";
      if (s.obj_flags != t.obj_flags) return here + " flags";
      if (a.name(s) != b.name(t)) return here + " name " + std::string(a.name(s)) + "/" + std::string(b.name(t));
      const bool count = s.sub == 0 && !s.has_default && !od::writable(s.access);
      const od::Literal u = a.default_of(s);
      const od::Literal v = b.default_of(t);
      if (!count && !(u == v)) return here + " default " + text_of_literal(u) + " " + text_of_literal(v);
      const od::Limits* const l = a.limits(s);
      const od::Limits* const m = b.limits(t);
      if ((l == nullptr) != (m == nullptr)) return here + " limits";
      if (l != nullptr && (!(l->low == m->low) || !(l->high == m->high))) return here + " limits";
    }
  }
  const auto image = [](const od::Description& of, const od::SubObject& sub, od::Values& device) {
    (void)of;
    const auto bytes = device.stored(sub);
    return std::vector<std::uint8_t>(bytes.begin(), bytes.end());
  };
  const auto alias = [](const od::Description& d) {
    return std::shared_ptr<const od::Description>(std::shared_ptr<const od::Description>(), &d);
  };
  od::Values first(alias(a), NodeId(9));
  od::Values second(alias(b), NodeId(9));
  for (std::size_t i = 0; i < a.subs().size(); ++i) {
    if (image(a, a.subs()[i], first) != image(b, b.subs()[i], second)) return "value " + std::to_string(i);
  }
  return {};
}

}  // namespace berth::eds::test
