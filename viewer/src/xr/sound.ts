import type { Vector3 } from 'three';
import type { Player } from '../audio/player.ts';

const AS_LOUD = 1.2; // m at which a voice is as loud as on the page

/**
 * The avatar's voice, heard from where the mouth is. The node stands between player and loudspeaker:
 * the clock of what is heard, and so the lips, do not change.
 */
export class VoiceInSpace {
  readonly panner: PannerNode;
  private readonly player: Player;

  constructor(player: Player) {
    this.player = player;
    this.panner = new PannerNode(player.context, { panningModel: 'HRTF', distanceModel: 'inverse', refDistance: AS_LOUD });
    player.through(this.panner);
  }

  /** @param mouth m from the visitor's head: to the right, up, and backwards, as a listener who never moves has it */
  place(mouth: Vector3): void {
    this.panner.positionX.value = mouth.x;
    this.panner.positionY.value = mouth.y;
    this.panner.positionZ.value = mouth.z;
  }

  /** Speaks as on the page again. */
  end(): void {
    this.player.through(null);
    this.panner.disconnect();
  }
}
