/** What is said of headsets. */
export const WORDS = {
  'immersive-vr': 'Enter VR',
  'immersive-ar': 'View in your room',
  refused: 'The headset did not let this page in.',
  impossible: 'The headset cannot show this page.',
  hands: 'Pinch and hold to talk.',
  controllers: 'Hold the trigger to talk. Push the stick forward to go somewhere, to the side to turn. B or Y leaves.',
  controllersInRoom: 'Hold the trigger to talk. Push the stick forward to have her stand elsewhere. B or Y leaves.',
  screen: 'Touch and hold the picture to talk.',
} as const;
