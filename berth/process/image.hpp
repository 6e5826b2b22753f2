/// The process image: the variables of an application with its own cycle and thread, or its own process
/// (shared_image.hpp). Declared once, by name and type:
///
///     process::Layout layout;
///     const auto level = layout.output<std::int16_t>("Silo level");     // comes from the network
///     const auto motor = layout.input<bool>("Belt motor");              // goes to the network
///     process::Image image(layout);
///
///     // the executor's thread                     // the application's thread, once a cycle
///     image.network().set(level, 215);             image.application().refresh();
///     image.network().publish();                   if (image.application().get(level) > 200)
///                                                    image.application().set(motor, false);
///                                                  image.application().commit();
///
/// Directions are seen from the network: an *input* variable is the network's input, which the application writes and a
/// TPDO carries; an *output* variable is the network's output, which an RPDO brings and the application reads
/// ("Distributed intelligence in CANopen", Figure 2; CiA 302-4).
///
/// Each side owns its working copy; `publish` and `refresh`, `commit` and `take` pass whole images (exchange.hpp).
/// Neither side ever waits, locks or uses the heap, and no image is torn: all variables are of one `publish`. Of
/// several publications before a `refresh`, only the newest is seen.
#pragma once

#include <memory>
#include <optional>

#include "berth/process/image_format.hpp"
#include "berth/rt/executor.hpp"

namespace berth::process {

/// Used from the executor's thread only.
class NetworkSide {
 public:
  using Clock = std::int64_t (*)() noexcept;
  /// `memory`: an image of that layout, begun; both must stay. `clock`: between processes, CLOCK_MONOTONIC in ns.
  NetworkSide(std::uint8_t* memory, const Layout& layout, const ImageFormat& format, Clock clock = nullptr);

  [[nodiscard]] const Layout& layout() const noexcept { return *layout_; }
  template <class T>
  bool set(Output<T> variable, T value) noexcept {
    return variable.store(outputs(), value);
  }
  /// Passes the values set so far to the application's next `refresh`.
  void publish() noexcept;
  /// True when the application has committed since the last `take`.
  bool take() noexcept { return inputs_.take(); }
  template <class T>
  [[nodiscard]] T get(Input<T> variable) const noexcept {
    return variable.load(inputs());
  }
  /// The application's other data in the taken image.
  [[nodiscard]] const InputHead& said() const noexcept {
    return *reinterpret_cast<const InputHead*>(inputs_.taken().data());
  }
  /// Of the last `publish`.
  [[nodiscard]] std::uint64_t number() noexcept { return head().number; }
  /// By offset, for code that maps objects.
  [[nodiscard]] std::span<std::uint8_t> outputs() noexcept { return outputs_.work().subspan(values_at_); }
  [[nodiscard]] std::span<const std::uint8_t> inputs() const noexcept {
    return inputs_.taken().subspan(ImageFormat::input_values_at);
  }

  /// @name Status of the outputs in the next `publish`, each by `Variable::number`
  /// @{
  void set_now(rt::Time now) noexcept { head().now_ns = now.time_since_epoch().count(); }
  void received(std::uint32_t output, rt::Time at) noexcept;
  /// The output's producer is lost.
  void silent(std::uint32_t output) noexcept;
  /// No output is received any more: the device is not operational.
  void wait() noexcept;
  [[nodiscard]] berth_diagnosis& diagnosis() noexcept;
  /// @}

 private:
  [[nodiscard]] OutputHead& head() noexcept { return *reinterpret_cast<OutputHead*>(outputs_.work().data()); }
  [[nodiscard]] OutputStatus* status(std::uint32_t output) noexcept;
  const Layout* layout_;
  std::size_t values_at_;
  Giver outputs_;
  Taker inputs_;
  Clock clock_;
};

/// Used from one thread of the application only.
class ApplicationSide {
 public:
  /// `memory`: an image of that format, begun, which must stay.
  ApplicationSide(std::uint8_t* memory, const ImageFormat& format);

  /// True when the network has published since; `get` then reads that snapshot.
  bool refresh() noexcept { return outputs_.take(); }
  template <class T>
  [[nodiscard]] T get(Output<T> variable) const noexcept {
    return variable.load(outputs());
  }
  template <class T, Direction way>
  [[nodiscard]] berth_validity validity(Handle<T, way> variable) const noexcept {
    static_assert(way == Direction::output, "an input is the application's own");
    return validity_of(variable.number());
  }
  /// Age of its last reception at the snapshot; empty while it is `BERTH_WAITING`.
  template <class T>
  [[nodiscard]] std::optional<rt::Duration> age(Output<T> variable) const noexcept {
    return age_of(variable.number());
  }
  /// False, and nothing is set: the value is out of the variable's type.
  template <class T>
  bool set(Input<T> variable, T value) noexcept {
    return variable.store(inputs(), value);
  }
  /// An error of the application, which the device sends as EMCY until there is another or, with code 0, none. Takes
  /// effect with the next `commit`.
  void set_error(std::uint16_t code, std::uint8_t error_register) noexcept {
    said().error_code = code;
    said().error_register = error_register;
  }
  /// Passes all inputs. Call it once a cycle even without changes: it is the application's sign of life.
  void commit() noexcept {
    said().seen = head().number;
    inputs_.give();
  }
  [[nodiscard]] std::span<const std::uint8_t> outputs() const noexcept { return outputs_.taken().subspan(values_at_); }
  [[nodiscard]] std::span<std::uint8_t> inputs() noexcept {
    return inputs_.work().subspan(ImageFormat::input_values_at);
  }

  /// The same by `Variable::number` of an output.
  [[nodiscard]] berth_validity validity_of(std::uint32_t output) const noexcept;
  [[nodiscard]] std::optional<rt::Duration> age_of(std::uint32_t output) const noexcept;
  /// When the snapshot was published.
  [[nodiscard]] const OutputHead& head() const noexcept {
    return *reinterpret_cast<const OutputHead*>(outputs_.taken().data());
  }
  [[nodiscard]] const berth_diagnosis& diagnosis() const noexcept;

 private:
  [[nodiscard]] const OutputStatus* status(std::uint32_t output) const noexcept;
  [[nodiscard]] InputHead& said() noexcept { return *reinterpret_cast<InputHead*>(inputs_.work().data()); }
  std::size_t values_at_;
  Taker outputs_;
  Giver inputs_;
};

/// Both sides in one process.
class Image {
 public:
  /// All values 0. Later changes of `layout` have no effect.
  explicit Image(const Layout& layout);
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;

  [[nodiscard]] const Layout& layout() const noexcept { return layout_; }
  [[nodiscard]] NetworkSide& network() noexcept { return network_; }
  [[nodiscard]] ApplicationSide& application() noexcept { return application_; }

 private:
  struct Free {
    void operator()(std::uint8_t* memory) const noexcept;
  };
  using Memory = std::unique_ptr<std::uint8_t, Free>;
  [[nodiscard]] static Memory begun(const ImageFormat& format);

  Layout layout_;
  ImageFormat format_;
  Memory memory_;
  NetworkSide network_;
  ApplicationSide application_;
};

}  // namespace berth::process
