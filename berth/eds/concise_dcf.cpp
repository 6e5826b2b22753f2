#include "berth/eds/concise_dcf.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "berth/base/bytes.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::eds {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t count_size = 4;
constexpr std::size_t head_size = 7;  ///< U16 index, U8 sub-index, U32 size

tl::unexpected<Error> wrong(std::size_t at, const char* text, ObjectRef object = {}) noexcept {
  return tl::unexpected<Error>(Error{.code = Errc::invalid,
                                     .sub = object.sub,
                                     .index = object.index,
                                     .detail = static_cast<std::uint32_t>(at),
                                     .text = text});
}

tl::unexpected<Error> about(ObjectRef object, Error error) noexcept {
  error.index = object.index;
  error.sub = object.sub;
  return tl::unexpected<Error>(error);
}

void put(Bytes& out, const ConciseEntry& entry) {
  const std::size_t at = out.size();
  out.resize(at + head_size);
  store_le(&out[at], entry.object.index);
  out[at + 2] = entry.object.sub;
  store_le(&out[at + 3], static_cast<std::uint32_t>(entry.data.size()));
  out.insert(out.end(), entry.data.begin(), entry.data.end());
}

}  // namespace

std::vector<std::uint8_t> encode(const ConciseDcf& dcf) {
  Bytes out(count_size);
  store_le(out.data(), static_cast<std::uint32_t>(dcf.entries.size()));
  for (const ConciseEntry& each : dcf.entries) put(out, each);
  return out;
}

Result<ConciseDcf> decode_concise_dcf(std::span<const std::uint8_t> stream) {
  ConciseDcf dcf;
  if (stream.empty()) return dcf;
  if (stream.size() < count_size) return wrong(0, "the stream ends inside the number of entries");
  const auto count = load_le<std::uint32_t>(stream.data());
  std::size_t at = count_size;
  if (count > (stream.size() - at) / head_size) return wrong(0, "more entries are declared than the stream can hold");
  dcf.entries.reserve(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (stream.size() - at < head_size) return wrong(at, "the stream ends inside the head of an entry");
    const ObjectRef object{load_le<std::uint16_t>(&stream[at]), stream[at + 2]};
    const auto size = load_le<std::uint32_t>(&stream[at + 3]);
    if (size > stream.size() - at - head_size) return wrong(at + 3, "an entry is longer than the rest", object);
    at += head_size;
    const auto data = stream.subspan(at, size);
    dcf.entries.push_back({object, {data.begin(), data.end()}});
    at += size;
  }
  if (at != stream.size()) return wrong(at, "bytes follow the last entry");
  return dcf;
}

Result<std::vector<std::uint8_t>> encode(const od::Literal& value, od::DataType type, NodeId node_id) {
  using Kind = od::Literal::Kind;
  if (!value.present()) return fail(Errc::invalid, "there is no value to encode");
  const std::size_t size = od::byte_size(type);
  if (size == 0) {
    if (value.kind != Kind::bytes) return fail(Errc::invalid, "a number for a type of variable length");
    return value.bytes;
  }
  if (value.kind == Kind::bytes) return fail(Errc::invalid, "bytes for a type that is a number");
  if (value.kind == Kind::node_id_plus && !node_id.configured()) {
    return fail(Errc::invalid, "$NODEID has no value: the node-ID is not known");
  }
  Bytes bytes(size);
  od::store(type, value.resolve(type, node_id.value()), bytes.data());
  return bytes;
}

Result<od::Literal> decode(std::span<const std::uint8_t> bytes, od::DataType type) {
  const std::size_t size = od::byte_size(type);
  if (size == 0) return od::Literal::octets(bytes);
  if (bytes.size() != size) return fail(Errc::mismatch, "the length is not that of the data type");
  return od::Literal::number(od::load(type, bytes.data()));
}

od::Literal with_formula(const od::Description& description, ObjectRef object, od::Literal value, NodeId node_id) {
  const od::SubObject* const sub = description.find(object);
  if (sub == nullptr || !sub->relative || value.kind != od::Literal::Kind::number || !node_id.configured()) {
    return value;
  }
  const od::Literal formula = description.default_of(*sub);
  return formula.resolve(sub->type, node_id.value()) == value.raw ? formula : value;
}

namespace {

constexpr std::uint32_t off = 0x8000'0000;        ///< bit 31 of a COB-ID: the object does not exist
constexpr std::uint32_t producing = 0x4000'0000;  ///< bit 30 of 1005h

/// Takes entries out of a set of values and puts them into a stream.
class Sorter {
 public:
  explicit Sorter(ConciseDcf dcf) {
    for (ConciseEntry& each : dcf.entries) values_.insert_or_assign(each.object, std::move(each.data));
  }

  ConciseDcf run() {
    while (!values_.empty()) {
      const std::uint16_t index = values_.begin()->first.index;
      if (index == 0x1010 || index == 0x1020) {
        hold_object(index);
      } else if (od::is_pdo_communication(index)) {
        pdo(index);
      } else if (od::is_pdo_mapping(index)) {
        pdo(static_cast<std::uint16_t>(index - od::to_mapping));
      } else if (od::within(index, od::cia301::default_server, od::cia301::last_client)) {
        sdo(index);
      } else if (index == 0x1005 || index == 0x1006 || index == 0x1019) {
        sync();
      } else if (index == 0x1014 || index == 0x1015) {
        emcy();
      } else {
        give(values_.begin()->first);
      }
    }
    for (const std::uint16_t last : {std::uint16_t{0x1020}, std::uint16_t{0x1010}}) {
      for (ConciseEntry& each : held_) {
        if (each.object.index == last) made_.entries.push_back(std::move(each));
      }
    }
    return std::move(made_);
  }

 private:
  std::optional<std::uint32_t> number(ObjectRef object) const {
    const auto found = values_.find(object);
    if (found == values_.end() || found->second.size() != 4) return std::nullopt;
    return load_le<std::uint32_t>(found->second.data());
  }
  void write(ObjectRef object, std::uint32_t value) {
    Bytes bytes(4);
    store_le(bytes.data(), value);
    made_.entries.push_back({object, std::move(bytes)});
  }
  void give(ObjectRef object) {
    const auto found = values_.find(object);
    if (found == values_.end()) return;
    made_.entries.push_back({object, std::move(found->second)});
    values_.erase(found);
  }
  /// All sub-indices from `first` on.
  void give_all(std::uint16_t index, std::uint8_t first) {
    for (;;) {
      const auto found = values_.lower_bound({index, first});
      if (found == values_.end() || found->first.index != index) return;
      give(found->first);
    }
  }
  void hold_object(std::uint16_t index) {
    while (!values_.empty() && values_.begin()->first.index == index) {
      held_.push_back({values_.begin()->first, std::move(values_.begin()->second)});
      values_.erase(values_.begin());
    }
  }
  void switch_off(ObjectRef cob_id) {
    if (const auto value = number(cob_id)) write(cob_id, *value | off);
  }

  void pdo(std::uint16_t communication) {
    const auto mapping = static_cast<std::uint16_t>(communication + od::to_mapping);
    const ObjectRef cob_id{communication, 1};
    switch_off(cob_id);
    give({communication, 0});
    give_all(communication, 2);
    const ObjectRef count{mapping, 0};
    const auto counted = values_.find(count);
    if (counted != values_.end()) made_.entries.push_back({count, Bytes(counted->second.size())});
    give_all(mapping, 1);
    give(count);
    const auto value = number(cob_id);
    if (value && (*value & off) != 0) {
      values_.erase(cob_id);  // `switch_off` has written it already
    } else {
      give(cob_id);
    }
  }
  void sdo(std::uint16_t index) {
    const bool both_on = (number({index, 1}).value_or(off) & number({index, 2}).value_or(off) & off) == 0;
    if (both_on) {
      switch_off({index, 1});
      switch_off({index, 2});
    }
    give({index, 0});
    give_all(index, 3);
    give_all(index, 1);
  }
  void sync() {
    const ObjectRef cob_id{0x1005, 0};
    const ObjectRef period{0x1006, 0};
    const ObjectRef overflow{0x1019, 0};
    const auto value = number(cob_id);
    if (value && (*value & producing) != 0) write(cob_id, *value & ~producing);
    if (values_.contains(overflow) && number(period).value_or(0) != 0) write(period, 0);
    give(overflow);
    give(period);
    give(cob_id);
    for (const std::uint16_t index : {std::uint16_t{0x1005}, std::uint16_t{0x1006}, std::uint16_t{0x1019}}) {
      give_all(index, 0);
    }
  }
  void emcy() {
    switch_off({0x1014, 0});
    give_all(0x1015, 0);
    const auto value = number({0x1014, 0});
    if (value && (*value & off) != 0) values_.erase({0x1014, 0});
    give_all(0x1014, 0);
  }

  std::map<ObjectRef, Bytes> values_;
  std::vector<ConciseEntry> held_;
  ConciseDcf made_;
};

/// A PDO's mapping can be changed only while its COB-ID says that it does not exist. If the parameters set only the
/// mapping, this adds the description's COB-ID.
void add_cob_ids(const od::Description& description, std::vector<Parameter>& parameters) {
  std::set<ObjectRef> there;
  for (const Parameter& each : parameters) there.insert(each.object);
  std::vector<Parameter> added;
  for (const Parameter& each : parameters) {
    if (!od::is_pdo_mapping(each.object.index)) continue;
    const ObjectRef cob_id{static_cast<std::uint16_t>(each.object.index - od::to_mapping), 1};
    const od::SubObject* const sub = description.find(cob_id);
    if (sub == nullptr || !sub->has_default || !od::writable(sub->access)) continue;
    if (!there.insert(cob_id).second) continue;
    added.push_back({cob_id, sub->type, description.default_of(*sub), each.line});
  }
  parameters.insert(parameters.end(), added.begin(), added.end());
}

bool downloadable(const od::Description& description, ObjectRef object) {
  const od::SubObject* const sub = description.find(object);
  if (sub == nullptr) return true;
  const od::Object* const parent = description.find(object.index);
  const unsigned flags = sub->obj_flags | parent->obj_flags;
  return od::writable(sub->access) && (flags & od::refuse_write_on_download) == 0;
}

}  // namespace

ConciseDcf in_working_order(ConciseDcf dcf) { return Sorter(std::move(dcf)).run(); }

Result<ConciseDcf> concise_dcf(const od::Description& description, std::span<const Parameter> parameters,
                               NodeId node_id, Order order) {
  std::vector<Parameter> wanted;
  for (const Parameter& each : parameters) {
    if (downloadable(description, each.object)) wanted.push_back(each);
  }
  if (order == Order::working) add_cob_ids(description, wanted);
  ConciseDcf dcf;
  for (const Parameter& each : wanted) {
    auto bytes = encode(each.value, each.type, node_id);
    if (!bytes) return about(each.object, bytes.error());
    dcf.entries.push_back({each.object, std::move(*bytes)});
  }
  return order == Order::working ? in_working_order(std::move(dcf)) : std::move(dcf);
}

Result<ConciseDcf> concise_dcf(const File& file, NodeId node_id, Order order) {
  return concise_dcf(*file.description, file.parameters, node_id, order);
}

Result<std::vector<Parameter>> parameters(const ConciseDcf& dcf, const od::Description& description, NodeId node_id) {
  std::map<ObjectRef, Parameter> last;
  for (const ConciseEntry& each : dcf.entries) {
    const od::SubObject* const sub = description.find(each.object);
    if (sub == nullptr)
      return about(each.object, {.code = Errc::not_found, .text = "the description does not have it"});
    auto value = decode(each.data, sub->type);
    if (!value) return about(each.object, value.error());
    od::Literal literal = with_formula(description, each.object, std::move(*value), node_id);
    last.insert_or_assign(each.object, Parameter{each.object, sub->type, std::move(literal)});
  }
  std::vector<Parameter> made;
  made.reserve(last.size());
  for (auto& [object, parameter] : last) made.push_back(std::move(parameter));
  return made;
}

}  // namespace berth::eds
