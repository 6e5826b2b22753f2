#include "berth/client/pdo.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/client/remote_node.hpp"

namespace berth::client {

namespace {

/// The type to decode a field by: the object's own, or, when the mapping has another length than the type, the
/// shortest integer of at least that length.
od::DataType type_to_use(const PdoLayout::Field& field) noexcept {
  if (od::known(field.type) && (od::bit_length(field.type) == 0 || od::bit_length(field.type) == field.bits)) {
    return field.type;
  }
  using enum od::DataType;
  constexpr od::DataType signed_types[] = {integer8,  integer16, integer24, integer32,
                                           integer40, integer48, integer56, integer64};
  constexpr od::DataType unsigned_types[] = {unsigned8,  unsigned16, unsigned24, unsigned32,
                                             unsigned40, unsigned48, unsigned56, unsigned64};
  const unsigned at = (field.bits - 1) / 8;
  return od::is_signed(field.type) ? signed_types[at] : field.bits == 1 ? boolean : unsigned_types[at];
}

std::uint64_t mask_of(unsigned bits) noexcept {
  return bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
}

Error error_at(const PdoLayout& layout, Errc code, ObjectRef ref, const char* text, od::AbortCode detail) noexcept {
  return {.code = code,
          .node = layout.node.value(),
          .sub = ref.sub,
          .index = ref.index,
          .detail = static_cast<std::uint32_t>(detail),
          .text = text};
}

}  // namespace

Outcome<const PdoLayout::Field*> PdoLayout::find(Selector selector) const {
  const auto ref = names->find(selector);
  if (!ref) {
    const auto code = ref.error().kind == od::NoObject::Kind::several ? Errc::duplicate : Errc::not_found;
    const Error error{.code = code, .node = node.value(), .text = "finding an object by its name"};
    return tl::unexpected(make_failure(error, {}, ref.error().why));
  }
  const auto it = std::ranges::find(fields, *ref, &Field::object);
  if (it != fields.end()) return &*it;
  const Error error = error_at(*this, Errc::not_found, *ref, "the PDO does not map the object", od::AbortCode::none);
  return tl::unexpected(make_failure(error, names->label(*ref)));
}

od::DataType PdoSample::type_of(const PdoLayout::Field& field) noexcept { return type_to_use(field); }

Bytes PdoSample::bytes_of(const PdoLayout::Field& field) const {
  const od::DataType type = type_of(field);
  std::uint64_t raw = load_le<std::uint64_t>(data.data()) >> field.at & mask_of(field.bits);
  if (od::byte_size(type) == 0) {
    Bytes bytes((field.bits + 7) / 8);
    for (auto& byte : bytes) {
      byte = static_cast<std::uint8_t>(raw);
      raw >>= 8;
    }
    return bytes;
  }
  if (od::is_signed(type) && (raw >> (field.bits - 1) & 1U) != 0) raw |= ~mask_of(field.bits);
  Bytes bytes(od::byte_size(type));
  od::store(type, raw, bytes.data());
  return bytes;
}

Failure PdoSample::wrong_type(const PdoLayout::Field& field, CppType wanted) const {
  return client::wrong_type(*layout->names, layout->node, field.object, type_of(field), wanted, "read as");
}

Failure PdoSample::refused(const PdoLayout::Field& field, Complaint complaint) const {
  return make_failure(error_at(*layout, Errc::mismatch, field.object, complaint.what, complaint.code),
                      layout->names->label(field.object));
}

Tpdo::Tpdo(RemoteNode& node, unsigned number, co::CobId cob_id, std::shared_ptr<const PdoLayout> layout)
    : node_(&node), number_(number), cob_id_(cob_id), layout_(std::move(layout)) {
  node.network_->dispatcher().add(can::only(cob_id.key()), *this);
}

void Tpdo::on_pdo(std::function<void(const PdoSample&)> call) { call_ = RemoteNode::share(std::move(call)); }

void Tpdo::end() noexcept {
  if (node_ == nullptr) return;
  node_->network_->dispatcher().remove(*this);
  node_ = nullptr;
  call_.reset();
  inbox_.close();
}

void Tpdo::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd) return;
  if (frame.size < layout_->size()) {
    ++too_short_;
    return;
  }
  ++count_;
  PdoSample sample{.layout = layout_, .at = at, .data = {}};
  std::copy_n(frame.data.begin(), layout_->size(), sample.data.begin());
  newest_ = sample;
  inbox_.push(sample);
  node_->tell(call_, sample);
}

Rpdo::Rpdo(RemoteNode& node, unsigned number, co::CobId cob_id, std::shared_ptr<const PdoLayout> layout)
    : node_(&node), number_(number), cob_id_(cob_id), layout_(std::move(layout)) {
  for (const auto& field : layout_->fields) {
    const auto* sub = node.description().find(field.object);
    if (sub == nullptr || !sub->has_default) continue;
    const od::Literal value = node.description().default_of(*sub);
    Bytes bytes = value.bytes;
    if (od::byte_size(sub->type) != 0) {
      bytes.resize(od::byte_size(sub->type));
      od::store(sub->type, value.resolve(sub->type, node.id().value()), bytes.data());
    }
    put(field, bytes);
  }
}

void Rpdo::put(const PdoLayout::Field& field, std::span<const std::uint8_t> bytes) noexcept {
  std::array<std::uint8_t, 8> wide{};
  std::copy_n(bytes.begin(), std::min(bytes.size(), wide.size()), wide.begin());
  const std::uint64_t mask = mask_of(field.bits) << field.at;
  const std::uint64_t raw = load_le<std::uint64_t>(wide.data()) << field.at & mask;
  store_le(data_.data(), (load_le<std::uint64_t>(data_.data()) & ~mask) | raw);
}

Outcome<void> Rpdo::set(Selector selector, Input value) {
  if (node_ == nullptr) return tl::unexpected(node_gone(layout_->node));
  const auto found = layout_->find(selector);
  if (!found) return tl::unexpected(found.error());
  const PdoLayout::Field& field = **found;
  const od::DataType type = type_to_use(field);
  const auto* sub = node_->description().find(field.object);
  Bytes bytes;
  Complaint complaint = node_->encode(sub != nullptr && sub->type == type ? sub : nullptr, type, value, bytes);
  if (complaint.what == nullptr && od::byte_size(type) != 0) {
    const std::uint64_t raw = od::load(type, bytes.data());
    const std::uint64_t kept = raw & mask_of(field.bits);
    const bool negative = od::is_signed(type) && (kept >> (field.bits - 1) & 1U) != 0;
    if (!od::is_real(type) && (negative ? kept | ~mask_of(field.bits) : kept) != raw) {
      complaint = {"the value does not fit into the bits that are mapped", od::AbortCode::value_too_high};
    }
  } else if (complaint.what == nullptr && bytes.size() * 8 > field.bits) {
    complaint = {"the value is longer than what is mapped", od::AbortCode::length_too_high};
  }
  if (complaint.what != nullptr && complaint.code == od::AbortCode::none) {
    return tl::unexpected(
        client::wrong_type(*layout_->names, layout_->node, field.object, type, value.cpp(), "written from"));
  }
  if (complaint.what != nullptr) {
    return tl::unexpected(make_failure(error_at(*layout_, Errc::invalid, field.object, complaint.what, complaint.code),
                                       layout_->names->label(field.object)));
  }
  put(field, bytes);
  return {};
}

Outcome<void> Rpdo::send() {
  if (node_ == nullptr) return tl::unexpected(node_gone(layout_->node));
  can::Frame frame = can::Frame::base(cob_id_.id(), std::span(data_).first(layout_->size()));
  if (cob_id_.extended()) frame = can::Frame::ext(cob_id_.id(), std::span(data_).first(layout_->size()));
  const char* why = nullptr;
  switch (node_->network_->dispatcher().send(frame)) {
    case can::Queued::yes: return {};
    case can::Queued::full: why = "the PDO did not leave: the transmit queue is full"; break;
    case can::Queued::bus_off: why = "the PDO did not leave: bus-off"; break;
    case can::Queued::listen_only: why = "the PDO did not leave: the port is listen-only"; break;
    case can::Queued::closed: why = "the PDO did not leave: the port is closed"; break;
  }
  return tl::unexpected(node_->failure(Errc::bus, why));
}

}  // namespace berth::client
