#include "berth/co/sdo_server.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"

namespace berth::co {

using sdo::Ccs;

namespace {
constexpr auto full_retry = std::chrono::milliseconds(1);
}  // namespace

SdoServer::SdoServer(od::Values& values, std::size_t buffer)
    : values_(&values), buffer_(std::make_unique<std::uint8_t[]>(buffer)), capacity_(buffer) {}

std::optional<can::Frame> SdoServer::handle(const can::Frame& request) noexcept {
  std::optional<can::Frame> answer;
  if (!sdo::well_formed(request)) return answer;
  const auto command = static_cast<Ccs>(sdo::specifier(request.data[0]));
  if (command == Ccs::abort) {
    reset();
    return answer;
  }
  if (state_ == State::pending && std::ranges::equal(pending_request_, request.bytes())) return answer;
  answer.emplace();
  answer->id = response_id_;
  answer->size = 8;
  switch (command) {
    case Ccs::download: begin_download(request, *answer); break;
    case Ccs::upload:
      ref_ = sdo::multiplexer(request);
      begin_upload(*answer);
      break;
    case Ccs::download_segment: download_segment(request, *answer); break;
    case Ccs::upload_segment: upload_segment(request, *answer); break;
    default: refuse_unknown(request, *answer);
  }
  if (state_ == State::pending) answer.reset();
  return answer;
}

std::optional<ObjectRef> SdoServer::pending() const noexcept {
  return state_ == State::pending ? std::optional(ref_) : std::nullopt;
}

void SdoServer::defer(const can::Frame& request, const can::Frame& answer) noexcept {
  state_ = State::pending;
  pending_answer_ = answer;
  std::ranges::copy(request.bytes(), pending_request_.begin());
}

std::optional<can::Frame> SdoServer::complete(AbortCode code) noexcept {
  if (state_ != State::pending || code == AbortCode::pending) return std::nullopt;
  reset();
  return code == AbortCode::none ? pending_answer_ : sdo::make_abort(response_id_, ref_, code);
}

std::optional<can::Frame> SdoServer::expire() noexcept {
  if (!busy() || state_ == State::pending) return std::nullopt;
  reset();
  return sdo::make_abort(response_id_, ref_, AbortCode::timeout);
}

void SdoServer::abort(can::Frame& answer, ObjectRef ref, AbortCode code) noexcept {
  reset();
  answer = sdo::make_abort(response_id_, ref, code);
}

void SdoServer::refuse_unknown(const can::Frame& request, can::Frame& answer) noexcept {
  // The initiates of block transfer name an object; their other frames and the rest do not.
  const auto command = static_cast<Ccs>(sdo::specifier(request.data[0]));
  const bool names_object = (command == Ccs::block_upload && (request.data[0] & 0x03U) == 0) ||
                            (command == Ccs::block_download && (request.data[0] & 0x01U) == 0);
  const auto current = busy() ? ref_ : ObjectRef{};
  abort(answer, names_object ? sdo::multiplexer(request) : current, AbortCode::command_specifier);
}

// ---- download

void SdoServer::begin_download(const can::Frame& request, can::Frame& answer) noexcept {
  reset();
  ref_ = sdo::multiplexer(request);
  const bool expedited = (request.data[0] & 0x02U) != 0;
  const auto code = expedited ? expedited_download(request) : begin_segmented_download(request);
  if (code != AbortCode::none && code != AbortCode::pending) return abort(answer, ref_, code);
  sdo::put(answer, 0x60, ref_);
  if (code == AbortCode::pending) defer(request, answer);
}

AbortCode SdoServer::expedited_download(const can::Frame& request) noexcept {
  const bool sized = (request.data[0] & 0x01U) != 0;
  std::size_t length = 4U - ((request.data[0] >> 2U) & 0x03U);
  if (!sized) {
    const auto counted = values_->length_of_unsized(ref_, 4);
    if (!counted) return counted.error();
    length = *counted;
  }
  return values_->write(ref_, std::span(request.data).subspan(4, length));
}

AbortCode SdoServer::begin_segmented_download(const can::Frame& request) noexcept {
  size_indicated_ = (request.data[0] & 0x01U) != 0;
  size_ = size_indicated_ ? load_le<std::uint32_t>(request.data.data() + 4) : 0;
  const auto code = size_indicated_ ? values_->check_write(ref_, size_) : values_->check_write(ref_);
  if (code != AbortCode::none) return code;
  if (size_ > capacity_) return AbortCode::out_of_memory;
  state_ = State::download;
  toggle_ = false;
  offset_ = 0;
  return AbortCode::none;
}

bool SdoServer::toggled(const can::Frame& request, can::Frame& answer) noexcept {
  if (((request.data[0] & sdo::toggle_bit) != 0) != toggle_) {
    abort(answer, ref_, AbortCode::toggle_bit);
    return false;
  }
  toggle_ = !toggle_;
  return true;
}

void SdoServer::download_segment(const can::Frame& request, can::Frame& answer) noexcept {
  if (state_ != State::download) return refuse_unknown(request, answer);
  if (!toggled(request, answer)) return;
  const auto byte = request.data[0];
  const bool last = (byte & 0x01U) != 0;
  const std::size_t count = sdo::segment_bytes - ((byte >> 1U) & 0x07U);
  const auto code = take(std::span(request.data).subspan(1, count), last);
  if (code != AbortCode::none && code != AbortCode::pending) return abort(answer, ref_, code);
  if (last) reset();
  answer.data[0] = static_cast<std::uint8_t>(0x20U | (byte & sdo::toggle_bit));
  if (code == AbortCode::pending) defer(request, answer);
}

AbortCode SdoServer::take(std::span<const std::uint8_t> bytes, bool last) noexcept {
  const auto total = offset_ + bytes.size();
  if (size_indicated_ && total > size_) return AbortCode::length_too_high;
  if (total > capacity_) {
    const auto code = values_->check_write(ref_, total);
    return code == AbortCode::none ? AbortCode::out_of_memory : code;
  }
  std::ranges::copy(bytes, buffer_.get() + offset_);
  offset_ = total;
  if (!last) return AbortCode::none;
  if (size_indicated_ && total < size_) return AbortCode::length_too_low;
  return values_->write(ref_, {buffer_.get(), total});
}

// ---- upload

void SdoServer::begin_upload(can::Frame& answer) noexcept {
  reset();
  const auto value = values_->view(ref_);
  if (!value) return abort(answer, ref_, value.error());
  size_ = value->size();
  if (size_ >= 1 && size_ <= 4) {
    sdo::put(answer, static_cast<std::uint8_t>(0x43U | ((4U - size_) << 2U)), ref_);
    for (std::size_t i = 0; i < size_; ++i) answer.data[4 + i] = (*value)[i];
    return;
  }
  buffered_ = size_ <= capacity_;
  if (buffered_) std::ranges::copy(*value, buffer_.get());
  state_ = State::upload;
  toggle_ = false;
  offset_ = 0;
  sdo::put(answer, 0x41, ref_, static_cast<std::uint32_t>(size_));
}

od::Answer<const std::uint8_t*> SdoServer::upload_source() noexcept {
  if (buffered_) return buffer_.get();
  const auto value = values_->view(ref_);
  if (!value) return od::refuse(value.error());
  if (value->size() != size_) return od::refuse(AbortCode::device_state);
  return value->data();
}

void SdoServer::upload_segment(const can::Frame& request, can::Frame& answer) noexcept {
  if (state_ != State::upload) return refuse_unknown(request, answer);
  if (!toggled(request, answer)) return;
  const auto source = upload_source();
  if (!source) return abort(answer, ref_, source.error());
  const auto count = std::min(size_ - offset_, sdo::segment_bytes);
  const bool last = offset_ + count == size_;
  answer.data[0] = static_cast<std::uint8_t>((request.data[0] & sdo::toggle_bit) |
                                             ((sdo::segment_bytes - count) << 1U) | (last ? 1U : 0U));
  std::copy_n(*source + offset_, count, answer.data.begin() + 1);
  offset_ += count;
  if (last) reset();
}

// ---- bound to a port

void SdoServerService::start(NodeId node) {
  stop();
  server_.set_response_id(sdo_response_id(node));
  dispatcher_->add(can::only(sdo_request_id(node)), *this);
}

void SdoServerService::stop() noexcept {
  dispatcher_->remove(*this);
  cancel();
  server_.reset();
  unsent_.reset();
}

void SdoServerService::received(const can::Frame& frame, rt::Time) noexcept {
  const auto reply = server_.handle(frame);
  unsent_.reset();  // a client that asks anew has given up the answer before
  if (reply) {
    answer(*reply);
  } else {
    arm();
  }
}

void SdoServerService::answer(const can::Frame& frame) noexcept {
  if (dispatcher_->send(frame) != can::Queued::full) return arm();
  unsent_ = frame;
  unsent_until_ = dispatcher_->executor().now() + timeout_;
  dispatcher_->executor().after(full_retry, *this);
}

bool SdoServerService::complete(AbortCode code) noexcept {
  const auto reply = server_.complete(code);
  if (reply) answer(*reply);
  return reply.has_value();
}

bool SdoServerService::complete(ObjectRef object, AbortCode code) noexcept {
  return server_.pending() == object && complete(code);
}

void SdoServerService::arm() noexcept {
  if (server_.busy() && !server_.pending() && timeout_ > rt::Duration::zero()) {
    dispatcher_->executor().after(timeout_, *this);
  } else {
    cancel_timer();
  }
}

void SdoServerService::run() noexcept {
  if (unsent_) {
    const bool full = dispatcher_->send(*unsent_) == can::Queued::full;
    const bool go_on = timeout_ <= rt::Duration::zero() || dispatcher_->executor().now() < unsent_until_;
    if (full && go_on) return dispatcher_->executor().after(full_retry, *this);
    unsent_.reset();
    return arm();
  }
  if (const auto abort = server_.expire()) answer(*abort);
}

}  // namespace berth::co
