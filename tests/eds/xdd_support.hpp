/// XDDs for the tests, put together from their parts.
#pragma once

#include <algorithm>
#include <string>

#include "berth/eds/xdd.hpp"
#include "support.hpp"

namespace berth::eds::test {

inline constexpr std::string_view mandatory_objects =
    R"(<CANopenObject index="1000" name="Device type" objectType="7" dataType="0007" accessType="ro" PDOmapping="no"/>
<CANopenObject index="1001" name="Error register" objectType="7" dataType="0005" accessType="ro" PDOmapping="no"/>
<CANopenObject index="1018" name="Identity" objectType="9" subNumber="2">
<CANopenSubObject subIndex="00" name="n" objectType="7" dataType="0005" accessType="const" defaultValue="1"/>
<CANopenSubObject subIndex="01" name="Vendor-ID" objectType="7" dataType="0007" accessType="ro" defaultValue="1"/>
</CANopenObject>)";

struct XddParts {
  std::string objects = {};     ///< below the mandatory ones
  std::string process = {};     ///< children of ApplicationProcess
  std::string layers = {};      ///< further children of ApplicationLayers
  std::string management = {};  ///< children of NetworkManagement
  std::string rates = {};       ///< children of baudRate
  std::string identity =
      "<vendorName>v</vendorName><vendorID>1</vendorID><productName>p</productName><productID>2</productID>";
  std::string function = {};                       ///< children of the device's ProfileBody behind DeviceIdentity
  std::string attributes = R"(fileName="t.xdd")";  ///< of both ProfileBodys
};

inline std::string xdd_text(const XddParts& parts) {
  const std::string process =
      parts.process.empty() ? "" : "<ApplicationProcess>" + parts.process + "</ApplicationProcess>";
  return R"(<?xml version="1.0" encoding="UTF-8"?>
<ISO15745ProfileContainer xmlns="http://www.canopen.org/xml/1.0" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
<ISO15745Profile><ProfileHeader/>
<ProfileBody xsi:type="ProfileBody_Device_CANopen" )" +
         parts.attributes + "><DeviceIdentity>" + parts.identity + "</DeviceIdentity>" + parts.function + process +
         R"(</ProfileBody></ISO15745Profile>
<ISO15745Profile><ProfileHeader/>
<ProfileBody xsi:type="ProfileBody_CommunicationNetwork_CANopen" )" +
         parts.attributes + "><ApplicationLayers><CANopenObjectList>\n" + std::string(mandatory_objects) + "\n" +
         parts.objects + "\n</CANopenObjectList>" + parts.layers +
         "</ApplicationLayers><TransportLayers><PhysicalLayer><baudRate>" + parts.rates +
         "</baudRate></PhysicalLayer></TransportLayers><NetworkManagement>" + parts.management +
         "</NetworkManagement></ProfileBody></ISO15745Profile></ISO15745ProfileContainer>\n";
}

inline Reading read_parts(const XddParts& parts) { return read_xdd(xdd_text(parts), "t.xdd"); }
inline Reading read_objects(std::string objects) { return read_parts({.objects = std::move(objects)}); }

/// 1-based line of the first place where `part` stands.
inline int line_of(const std::string& text, std::string_view part) {
  return 1 +
         static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(text.find(part)), '\n'));
}

inline std::string all_findings(const Findings& findings) {
  std::string text;
  for (const auto& each : findings) text += to_string(each) + "\n";
  return text;
}

}  // namespace berth::eds::test
